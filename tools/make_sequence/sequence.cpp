#include "make_sequence/sequence.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "make_sequence/random.h"

namespace loopd::sequence {
namespace {

constexpr double kRad = std::numbers::pi / 180;
constexpr double kSameM = 1.5;
constexpr double kSameDeg = 35;
constexpr double kDontCareDeg = 60;
constexpr double kLeftAfterM = 10;  // a walk this long has left the place
constexpr double kEyeM = 1.25;
constexpr double kDefaultLoopM = 60;
constexpr double kMaxOffsetM = 0.5;
constexpr int kMaxFrames = 1'000'000;

/// A smooth wobble in -1..1: three waves of unlike lengths with seeded phases.
double wobble(double walked_m, std::uint64_t seed, std::uint64_t channel) {
  Random random(mix64(seed ^ (channel * 0x51ed2701ULL)));
  double sum = 0;
  for (const double wave_m : {3.1, 7.7, 19.3}) {
    sum += std::sin(2 * std::numbers::pi * (walked_m / wave_m + random.uniform()));
  }
  return sum / 3;
}

double fitted_loop_m(const SequenceOptions& o) {
  if (o.loop_m > 0) return o.loop_m;
  if (o.frames == 0) return kDefaultLoopM;
  // A third of a step more, so that later laps do not stop at the very same spots.
  return (o.frames / o.laps + 0.37) * o.step_m;
}

SceneOptions scene_options(const SequenceOptions& o) {
  return {fitted_loop_m(o), o.texture, o.lap_change, o.seed, o.sameness};
}

Camera make_camera(const SequenceOptions& o) {
  const double focal = o.width_px / 2.0 / std::tan(o.fov_deg / 2 * kRad);
  return {o.width_px, o.height_px, focal, (o.width_px - 1) / 2.0, (o.height_px - 1) / 2.0};
}

/// Collects "name = value. Violated: range" sentences.
class Violations {
 public:
  void range(const std::string& name, double value, double lo, double hi) {
    if (value >= lo && value <= hi) return;  // false for NaN too
    add(name + " = " + number(value) + ". Violated: " + number(lo) + " <= " + name +
        " <= " + number(hi));
  }
  void add(std::string sentence) { list_.push_back(std::move(sentence)); }
  std::vector<std::string> take() { return std::move(list_); }

 private:
  static std::string number(double value) {
    char text[32];
    std::snprintf(text, sizeof text, "%g", value);
    return text;
  }
  std::vector<std::string> list_;
};

void check_loop(const SequenceOptions& o, Violations& bad) {
  const double loop = fitted_loop_m(o);
  if (loop >= kMinLoopM && loop <= kMaxLoopM) return;
  bad.add("the loop would be " + std::to_string(loop) + " m long (frames / laps * step, or loop)." +
          " Violated: " + std::to_string(kMinLoopM) + " <= loop <= " + std::to_string(kMaxLoopM));
}

}  // namespace

std::vector<std::string> validate(const SequenceOptions& o) {
  Violations bad;
  bad.range("frames", o.frames, 0, kMaxFrames);
  bad.range("parked", o.parked, 0, kMaxFrames);
  if (o.frames == 0 && o.parked == 0) bad.add("frames = 0 and parked = 0: nothing to render");
  bad.range("width", o.width_px, 16, 8192);
  bad.range("height", o.height_px, 16, 8192);
  bad.range("fov", o.fov_deg, 20, 130);
  const double aspect = static_cast<double>(o.height_px) / std::max(1, o.width_px);
  if (aspect * std::tan(o.fov_deg / 2 * kRad) > 3) {
    bad.add("fov is too wide for this height: the vertical field of view would pass 140 degrees");
  }
  bad.range("laps", o.laps, 0.1, 1000);
  bad.range("step", o.step_m, 0.001, 5);
  bad.range("texture", o.texture, 0, 1);
  bad.range("sameness", o.sameness, 0, 1);
  bad.range("noise", o.noise, 0, 50);
  bad.range("blur", o.blur_px, 0, 10);
  bad.range("exposure", o.exposure, 0, 0.9);
  bad.range("offset", o.offset_m, -kMaxOffsetM, kMaxOffsetM);
  bad.range("gap", o.gap, 1, kMaxFrames);
  bad.range("dont-care", o.dont_care_m, kSameM, 100);
  bad.range("fps", o.fps, 0, 1000);
  bad.range("jpeg-quality", o.jpeg_quality, 1, 100);
  check_loop(o, bad);
  return bad.take();
}

Sequence::Sequence(const SequenceOptions& options)
    : options_(options),
      camera_(make_camera(options)),
      scene_(build_scene(scene_options(options))),
      walk_(scene_.corners, scene_.corner_radius_m) {
  plan_.reserve(static_cast<std::size_t>(options.parked + options.frames));
  for (int i = 0; i < options.parked; ++i) plan_.push_back(plan_frame(0));
  for (int i = 0; i < options.frames; ++i) plan_.push_back(plan_frame(i * options.step_m));
}

FramePlan Sequence::plan_frame(double walked_m) const {
  const auto shake = [&](std::uint64_t channel) {
    return wobble(walked_m, options_.seed, channel);
  };
  FramePlan frame;
  frame.walked_m = walked_m;
  const double laps = walked_m / walk_.length_m();
  frame.lap = static_cast<int>(laps);
  // The change of path between laps fades in and out over two metres.
  const double into_lap = walked_m - frame.lap * walk_.length_m();
  const double ramp = std::clamp(into_lap / 2, 0.0, 1.0);
  const double odd = frame.lap % 2 == 1 ? ramp : frame.lap > 0 ? 1 - ramp : 0;
  const WalkPoint at = walk_.at(walked_m);
  const double aside = 0.07 * shake(1) + odd * options_.offset_m;
  const Vec3 position{at.x - aside * std::sin(at.heading_rad),
                      at.y + aside * std::cos(at.heading_rad), kEyeM + 0.012 * shake(2)};
  const double heading = at.heading_rad + (2.0 * shake(3) + odd * 8 * options_.offset_m) * kRad;
  frame.pose = make_pose(position, heading, 0.8 * shake(4) * kRad, 0.6 * shake(5) * kRad);
  const double phase = 2 * std::numbers::pi * (walked_m / 37 + 0.31 * frame.lap);
  frame.gain = 1 + options_.exposure * std::sin(phase);
  return frame;
}

namespace {

double angle_deg(const Pose& a, const Pose& b) {
  return std::acos(std::clamp(dot(a.forward, b.forward), -1.0, 1.0)) / kRad;
}

/// The label of a pair, 0 if they are different places.
double label_of(const FramePlan& a, const FramePlan& b, int gap, const SequenceOptions& o) {
  const Vec3 d = a.pose.position - b.pose.position;
  const double metres = std::sqrt(dot(d, d));
  const double degrees = angle_deg(a.pose, b.pose);
  if (metres > o.dont_care_m || degrees > kDontCareDeg) return 0;
  const bool left = std::abs(a.walked_m - b.walked_m) >= kLeftAfterM;
  return metres <= kSameM && degrees <= kSameDeg && gap >= o.gap && left ? 1 : 0.5;
}

}  // namespace

std::vector<TruePair> ground_truth(const std::vector<FramePlan>& plan,
                                   const SequenceOptions& options) {
  std::vector<TruePair> pairs;
  std::map<std::pair<int, int>, std::vector<int>> cells;  // earlier frames by place
  const auto cell_of = [&](double v) {
    return static_cast<int>(std::floor(v / options.dont_care_m));
  };
  for (int query = 0; query < static_cast<int>(plan.size()); ++query) {
    const FramePlan& frame = plan[static_cast<std::size_t>(query)];
    const int cx = cell_of(frame.pose.position.x);
    const int cy = cell_of(frame.pose.position.y);
    const std::size_t first = pairs.size();
    for (int cell = 0; cell < 9; ++cell) {
      const auto found = cells.find({cx + cell % 3 - 1, cy + cell / 3 - 1});
      if (found == cells.end()) continue;
      for (const int match : found->second) {
        const double label =
            label_of(frame, plan[static_cast<std::size_t>(match)], query - match, options);
        if (label > 0) pairs.push_back({query, match, label});
      }
    }
    std::sort(pairs.begin() + static_cast<std::ptrdiff_t>(first), pairs.end(),
              [](const TruePair& a, const TruePair& b) { return a.match < b.match; });
    cells[{cx, cy}].push_back(query);
  }
  return pairs;
}

FrameRenderer::FrameRenderer(const Sequence& sequence)
    : sequence_(sequence), renderer_(sequence.scene(), sequence.camera()) {}

const std::vector<std::uint8_t>& FrameRenderer::render(std::size_t index) {
  const FramePlan& frame = sequence_.plan()[index];
  const SequenceOptions& o = sequence_.options();
  renderer_.render(frame.pose, frame.lap, radiance_);
  const std::uint64_t noise_seed = mix64(o.seed * 0x2545f4914f6cdd1dULL + index);
  expose(radiance_, o.width_px, o.height_px, frame.gain, {o.noise, o.blur_px}, noise_seed, pixels_);
  return pixels_;
}

}  // namespace loopd::sequence
