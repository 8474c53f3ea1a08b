#pragma once

#include <array>
#include <cstdint>

#include "loopd/features.h"
#include "support/descriptor_samples.h"

namespace loopd {

/// What a camera sees that moves along a closed route past a wall, as features without images: each
/// place of the wall has its points and lines for ever, and every view adds noise to position and
/// descriptor and some features that are never seen again. Needs no memory for the route, however
/// long: a landmark is a function of its number. Deterministic.
class FeatureWalk {
 public:
  struct Shape {
    std::uint64_t route_landmarks = 40'000;  ///< points along the route; as many /5 lines
    std::uint32_t points = 300;              ///< in each view
    std::uint32_t lines = 60;
    std::uint32_t step = 30;   ///< landmarks that leave the view from one frame to the next
    double fleeting = 0.3;     ///< share of features that are never seen again
    std::uint32_t wander = 0;  ///< each lap is seen from up to so many landmarks further on
  };

  explicit FeatureWalk(const Shape& shape, std::uint64_t seed = 1) : shape_(shape), seed_(seed) {
    DescriptorSamples samples(seed);
    for (Descriptor& prototype : prototypes_) prototype = samples.independent();
  }

  std::uint64_t frames_per_lap() const { return shape_.route_landmarks / shape_.step; }

  /// The view of frame `number`; `features` keeps its capacity.
  void see(std::uint64_t number, Features& features) const {
    DescriptorSamples noise(seed_ * 7919 + number + 1);
    const std::uint64_t lap = number / frames_per_lap();
    const std::uint64_t first = number * shape_.step + (lap * 17) % (shape_.wander + 1);
    features.clear();
    features.width_px = 640;
    features.height_px = 480;
    for (std::uint32_t i = 0; i < shape_.points; ++i) add_point(first, i, noise, features);
    for (std::uint32_t i = 0; i < shape_.lines; ++i) add_line(first / 5, i, noise, features);
  }

 private:
  static constexpr std::uint64_t kLineNumbers = std::uint64_t{1} << 40;

  static float between(DescriptorSamples& samples, float low, float high) {
    return low + (high - low) * static_cast<float>(samples.below(1 << 20)) / float{1 << 20};
  }

  // Descriptors come in families, as those of corners do: about 96 bits apart within one.
  Descriptor landmark(DescriptorSamples& of_landmark) const {
    Descriptor made = prototypes_[of_landmark.below(kPrototypes)];
    for (auto& word : made.words) word ^= of_landmark.next() & of_landmark.next();
    return made;
  }

  // About 14 bits flipped, as between two views of a corner.
  static Descriptor seen(Descriptor descriptor, DescriptorSamples& noise) {
    for (auto& word : descriptor.words)
      word ^= noise.next() & noise.next() & noise.next() & noise.next() & noise.next();
    for (auto& word : descriptor.words)
      word ^= noise.next() & noise.next() & noise.next() & noise.next() & noise.next();
    return descriptor;
  }

  bool is_fleeting(DescriptorSamples& noise) const {
    return static_cast<double>(noise.below(1 << 16)) < shape_.fleeting * (1 << 16);
  }

  void add_point(std::uint64_t first, std::uint32_t i, DescriptorSamples& noise,
                 Features& features) const {
    const std::uint64_t number =
        is_fleeting(noise) ? noise.next() : (first + i) % shape_.route_landmarks;
    DescriptorSamples of_landmark(seed_ * 104'729 + number);
    const float place = 640.0F * static_cast<float>(i) / static_cast<float>(shape_.points);
    features.points.push_back({place + between(noise, -0.3F, 0.3F),
                               between(of_landmark, 20, 460) + between(noise, -0.3F, 0.3F), 31, 0});
    features.point_descriptors.push_back(seen(landmark(of_landmark), noise));
  }

  void add_line(std::uint64_t first, std::uint32_t i, DescriptorSamples& noise,
                Features& features) const {
    const std::uint64_t number =
        is_fleeting(noise) ? noise.next() : (first + i) % (shape_.route_landmarks / 5);
    DescriptorSamples of_landmark(seed_ * 1'299'709 + kLineNumbers + number);
    const float x = 640.0F * static_cast<float>(i) / static_cast<float>(shape_.lines);
    const float y = between(of_landmark, 20, 400);
    features.lines.push_back(
        {x, y, x + between(of_landmark, -30, 30), y + between(of_landmark, 20, 60)});
    features.line_descriptors.push_back(seen(landmark(of_landmark), noise));
  }

  static constexpr std::uint32_t kPrototypes = 256;
  Shape shape_;
  std::uint64_t seed_;
  std::array<Descriptor, kPrototypes> prototypes_;
};

}  // namespace loopd
