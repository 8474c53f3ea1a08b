// The script in docs/recording.md reads what we write.

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>

#include "base/frame_pool.h"
#include "capture/file_camera.h"
#include "support/camera_events.h"
#include "support/child_process.h"
#include "support/recording_file.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using testing::make_shot;
using testing::next_frame;
using testing::RecordingBytes;
using testing::TempDir;

std::string script_of_the_page() {
  std::ifstream file(LOOPD_SOURCE_DIR "/docs/recording.md");
  std::stringstream page;
  page << file.rdbuf();
  const std::string text = page.str();
  const std::string opening = "```python\n";
  const std::size_t begin = text.find(opening);
  const std::size_t end = text.find("```\n", begin + opening.size());
  if (begin == std::string::npos || end == std::string::npos) return "";
  return text.substr(begin + opening.size(), end - begin - opening.size());
}

TEST(RecordingScriptTest, TurnsARecordingIntoADatasetOfTheSameFrames) {
  const TempDir dir;
  RecordingBytes recording;
  for (int i = 0; i < 4; ++i)
    recording.add(make_shot(30 + i, 20 - i, 5 + static_cast<std::uint64_t>(i), 1'000'000 * i - 7));
  const std::string path = dir.write("recording", recording.bytes + "cut").string();
  const std::string script = dir.write("script.py", script_of_the_page()).string();
  const std::string dataset = (dir / "dataset").string();
  testing::ChildProcess python({"/usr/bin/env", "python3", script, path, dataset},
                               (dir / "output").string());
  ASSERT_EQ(python.wait(), 0) << python.standard_error();

  FramePool pool(2, 4096);
  const auto recorded = open_file_camera({.path = path}, pool);
  const auto converted = open_file_camera({.path = dataset}, pool);
  ASSERT_TRUE(recorded.ok()) << recorded.error().message;
  ASSERT_TRUE(converted.ok()) << converted.error().message;
  for (int i = 0; i < 4; ++i) {
    const Frame a = next_frame(*recorded.value());
    const Frame b = next_frame(*converted.value());
    ASSERT_EQ(a.width_px, b.width_px);
    ASSERT_EQ(a.height_px, b.height_px);
    EXPECT_EQ(a.time_ns, b.time_ns);
    EXPECT_TRUE(
        std::equal(a.buffer.get(), a.buffer.get() + a.width_px * a.height_px, b.buffer.get()));
  }
}

}  // namespace
}  // namespace loopd
