#pragma once

#include <cstddef>
#include <functional>
#include <memory>

#include "loopd/config.h"
#include "loopd/features.h"
#include "loopd/frame.h"
#include "loopd/report.h"

namespace loopd {

/// Runs the two halves of a stage, points and lines, each exactly once, and returns when both are
/// done. The result of the detector never depends on how.
class LaneExecutor {
 public:
  virtual ~LaneExecutor() = default;
  /// If a lane throws, the other still finishes and the exception is rethrown here.
  virtual void run(const std::function<void()>& points, const std::function<void()>& lines) = 0;
};

/// The LiPo-LCD loop-closure detector (Company-Corcoles, Garcia-Fidalgo, Ortiz, BMVC 2020): points
/// and lines, two incremental vocabularies of binary words, rank fusion, islands, epipolar check.
///
/// Synchronous; has no thread, file or socket of its own. The same frames and config give the same
/// reports (but for times), bit for bit. Thread: one caller at a time; process() and absorb()
/// alternate.
class Detector {
 public:
  /// Precondition: validate(config) is empty. `lanes` may be null (both halves run in the caller's
  /// thread) and must outlive the detector.
  explicit Detector(const Config& config, LaneExecutor* lanes = nullptr);
  ~Detector();
  Detector(const Detector&) = delete;
  Detector& operator=(const Detector&) = delete;

  /// Decides about `frame` and fills `report` (cleared first). Changes nothing that a search sees.
  /// Any frame with 1 <= width, height and stride >= width is answered. Never throws for what is
  /// in the image; a failure inside becomes Outcome::kError and leaves the map as it was.
  void process(const Frame& frame, Report& report);

  /// The same for an image described elsewhere (streamed or recorded features). Precondition: as
  /// many descriptors as points and as lines.
  void process(const Features& features, std::uint64_t sequence,
               std::optional<std::int64_t> time_ns, Report& report);

  /// Brings the vocabularies up to date after process() of the same frame: the image that leaves
  /// the waiting window becomes searchable. Fills update_ns, words and bytes of `report`.
  void absorb(Report& report);

  /// Forgets everything: from now on as newly made, image ids from 0 again. Thread: as process().
  void clear();

  /// Features of the newest processed frame, or of a searchable image; null if `image` is neither.
  /// Valid until the next call of this, process() or absorb().
  const Features* features(ImageId image);

  /// Bytes of the map and the vocabularies that are in use.
  std::size_t bytes() const;
  /// Bytes when they are full: at most `Config::memory_budget_bytes`.
  std::size_t capacity_bytes() const;

 private:
  const Config config_;
  LaneExecutor* const lanes_;
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace loopd
