#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "base/result.h"
#include "make_sequence/floor_plan.h"
#include "make_sequence/geometry.h"
#include "make_sequence/renderer.h"
#include "make_sequence/scene.h"
#include "make_sequence/sensor.h"

namespace loopd::sequence {

enum class ImageFormat : std::uint8_t { kPng, kJpeg };

/// What to render. Lengths in metres, angles in degrees; ranges are those of `validate`.
struct SequenceOptions {
  int frames = 400;  ///< frames of the walk
  int parked = 0;    ///< frames standing still before it, with fresh noise each
  int width_px = 640;
  int height_px = 480;
  double fov_deg = 80;  ///< horizontal field of view
  double laps = 2;
  double step_m = 0.3;  ///< walked from frame to frame
  double loop_m = 0;    ///< length of a lap; 0 = fitted, so that `frames` steps make `laps` laps
  std::uint64_t seed = 1;
  double texture = 1;       ///< 0..1, point-like texture: posters, plates, marks, grain
  double sameness = 0.3;    ///< 0..1, of the legs' dimensions and tones; 1 = exact copies
  double noise = 2;         ///< sensor noise, grey levels
  double blur_px = 0.6;     ///< standard deviation of the lens blur
  double exposure = 0.1;    ///< amplitude of a slow gain drift; its phase differs on later laps
  double offset_m = 0.15;   ///< to the left of the first lap's path on odd laps
  bool lap_change = false;  ///< some lamps are switched on odd laps
  int gap = 50;             ///< least index difference of a ground-truth pair
  double dont_care_m = 3;   ///< pairs up to this far apart are don't care (see ground_truth)
  double fps = 0;           ///< frame rate for times.txt; 0 = no times.txt
  ImageFormat format = ImageFormat::kPng;
  int jpeg_quality = 90;
};

/// All violations, one sentence each; empty if `options` may be rendered.
std::vector<std::string> validate(const SequenceOptions& options);

/// Where and how one frame is taken.
struct FramePlan {
  Pose pose;
  double walked_m = 0;
  int lap = 0;
  double gain = 1;
};

/// One row of groundtruth.csv: `match` < `query`; label 1 same place, 0.5 don't care.
struct TruePair {
  int query = 0;
  int match = 0;
  double label = 0;
};

/// Same place (1): within 1.5 m and 35 degrees, at least `gap` frames apart, with a walk of at
/// least 10 m in between (who has not left a place cannot return to it). Don't care (0.5): within
/// `dont_care_m` and 60 degrees otherwise. In a corridor the views of places further apart along
/// the same leg still overlap, but a match there is metres wrong, so it counts as an error; beyond
/// 60 degrees of 80 the views hardly overlap. Sorted by query, then match. Cost: near linear.
std::vector<TruePair> ground_truth(const std::vector<FramePlan>& plan,
                                   const SequenceOptions& options);

/// A sequence ready to be rendered: scene, camera and the plan of every frame. Immutable once made;
/// the same options give the same sequence. Thread: reading is thread-safe.
class Sequence {
 public:
  /// Precondition: validate(options) is empty.
  explicit Sequence(const SequenceOptions& options);
  const SequenceOptions& options() const { return options_; }
  const Camera& camera() const { return camera_; }
  const Scene& scene() const { return scene_; }
  const std::vector<FramePlan>& plan() const { return plan_; }
  double loop_m() const { return walk_.length_m(); }

 private:
  FramePlan plan_frame(double walked_m) const;
  SequenceOptions options_;
  Camera camera_;
  Scene scene_;
  Walk walk_;
  std::vector<FramePlan> plan_;
};

/// Renders single frames of a sequence in any order. Thread: one thread each; the sequence must
/// outlive it.
class FrameRenderer {
 public:
  explicit FrameRenderer(const Sequence& sequence);
  /// Pixels of frame `index` (row-major, rows packed); valid until the next call.
  const std::vector<std::uint8_t>& render(std::size_t index);

 private:
  const Sequence& sequence_;
  Renderer renderer_;
  Radiance radiance_;
  std::vector<std::uint8_t> pixels_;
};

/// Renders everything into folder `out` (made if missing) in the dataset format: images/,
/// groundtruth.csv, poses.tum, camera.json, info.json and, if fps > 0, times.txt.
/// `progress(done, total)` is called from a rendering thread after each frame, one call at a time.
/// Errors: invalid options; `out` holds another sequence's images; a file cannot be written.
Status write_sequence(const SequenceOptions& options, const std::filesystem::path& out, int threads,
                      const std::function<void(std::size_t, std::size_t)>& progress);

}  // namespace loopd::sequence
