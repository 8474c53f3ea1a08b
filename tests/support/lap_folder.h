#pragma once

#include <cstdio>
#include <string>

#include "support/image_files.h"
#include "support/scene_image.h"
#include "support/temp_dir.h"

namespace loopd::testing {

/// Two laps along a wall, `places` images each, the second a few pixels beside the first and with
/// other noise: every image of the second lap shows a place seen before. Small, for tests.
inline void write_laps(const TempDir& folder, int places, int laps = 2) {
  constexpr int kStep_px = 20;
  constexpr int kWidth = 240;
  constexpr int kHeight = 180;
  for (int i = 0; i < laps * places; ++i) {
    const int lap = i / places;
    const Image wall = wall_image(7, (i % places) * kStep_px + 3 * lap, kWidth, kHeight);
    const Image image = with_noise(wall, 3.0, static_cast<unsigned>(i + 1));
    char name[16];
    std::snprintf(name, sizeof name, "%04d.pgm", i);
    folder.write(name, pgm_file({kWidth, kHeight, 1, image.pixels}));
  }
}

}  // namespace loopd::testing
