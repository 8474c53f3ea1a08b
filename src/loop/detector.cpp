#include "loopd/detector.h"

#include <algorithm>
#include <cassert>
#include <chrono>
#include <cmath>
#include <exception>
#include <utility>

#include "features/feature_extractor.h"
#include "index/vocabulary.h"
#include "loop/capacity.h"
#include "loop/eviction.h"
#include "loop/fusion.h"
#include "loop/islands.h"
#include "loop/map.h"
#include "loop/stillness.h"
#include "verify/verifier.h"

namespace loopd {
namespace {

using SteadyClock = std::chrono::steady_clock;

// Adds the time of its scope to a stage.
class StageTimer {
 public:
  explicit StageTimer(std::int64_t& stage_ns) : stage_ns_(stage_ns), start_(SteadyClock::now()) {}
  ~StageTimer() {
    stage_ns_ +=
        std::chrono::duration_cast<std::chrono::nanoseconds>(SteadyClock::now() - start_).count();
  }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  std::int64_t& stage_ns_;
  SteadyClock::time_point start_;
};

constexpr int kMaxEvictions = 2;                      // before an insertion: bounds its time
constexpr int kMaxStillCredit = 10;                   // frames
constexpr std::int64_t kMaxFrameNs = 10'000'000'000;  // a longer pause is no time under way

// Time from one frame to the next; none where it is not known or does not advance. Any stamps are
// answered: a driver may lie.
std::int64_t time_under_way(std::optional<std::int64_t> before, std::optional<std::int64_t> now) {
  if (!before || !now || *now <= *before) return 0;
  const std::uint64_t elapsed =
      static_cast<std::uint64_t>(*now) - static_cast<std::uint64_t>(*before);
  return static_cast<std::int64_t>(std::min(elapsed, static_cast<std::uint64_t>(kMaxFrameNs)));
}

class InlineLanes : public LaneExecutor {
 public:
  void run(const std::function<void()>& points, const std::function<void()>& lines) override {
    std::exception_ptr failure;
    try {
      points();
    } catch (...) {
      failure = std::current_exception();
    }
    lines();
    if (failure) std::rethrow_exception(failure);
  }
};

template <std::size_t N>
void copy_head(const std::vector<Candidate>& from, FixedVector<Candidate, N>& to) {
  for (const Candidate& c : from)
    if (!to.push_back(c)) return;
}

// The view that shares the most shows its inliers all over; a rich poster has them in one spot.
double conviction(const Verification& v) {
  return v.inliers() * std::sqrt(static_cast<double>(v.cells));
}

}  // namespace

class Detector::Impl {
 public:
  Impl(const Config& config, LaneExecutor* lanes)
      : config_(config),
        lanes_(lanes != nullptr ? *lanes : inline_lanes_),
        extractor_(config.features),
        capacity_(map_layout(config)),
        point_words_(config.index, capacity_.points),
        line_words_(config.index, capacity_.lines),
        point_lane_(config.verify),
        line_lane_(config.verify),
        stillness_(config.loop),
        map_(config.loop, capacity_.images, capacity_.blob_chunks) {
    assert(validate(config).empty());
    reserve();
  }

  // `describe` fills features_; all that follows is the same wherever they come from.
  template <class Describe>
  void process(std::uint64_t sequence, std::optional<std::int64_t> time_ns, Report& report,
               const Describe& describe) {
    report.clear();
    report.query = next_id_++;
    report.sequence = sequence;
    report.time_ns = time_ns;
    pending_ = false;
    const StageTimer total(report.times.total_ns);
    try {
      describe();
      report.outcome = decide(report);
    } catch (...) {  // whatever failed costs this frame only: it decides nothing and is not kept
      forget_evidence(report);
      report.outcome = Outcome::kError;
      pending_ = false;
    }
    priority_ = report.outcome == Outcome::kLoop ? report.island : std::nullopt;
  }

  void process(const Frame& frame, Report& report) {
    process(frame.sequence, frame.time_ns, report, [&] {
      const StageTimer timer(report.times.features_ns);
      describe(frame.view());
    });
  }

  void process(const Features& features, std::uint64_t sequence,
               std::optional<std::int64_t> time_ns, Report& report) {
    process(sequence, time_ns, report, [&] { features_ = features; });
  }

  void absorb(Report& report) {
    const StageTimer total(report.times.total_ns);
    const StageTimer update(report.times.update_ns);
    try {
      if (std::exchange(pending_, false)) keep(report);
      admit_ready();
    } catch (...) {  // made up for by the next absorb()
      report.outcome = report.outcome == Outcome::kLoop ? Outcome::kLoop : Outcome::kError;
    }
    report.words_points = point_words_.words();
    report.words_lines = line_words_.words();
    report.images = map_.searchable();
    report.bytes = bytes();
    report.evictions = evictions_;
  }

  const Features* features(ImageId image) {
    if (next_id_ > 0 && image == next_id_ - 1) return &features_;
    const MapImage* kept = map_.find(image);
    if (kept == nullptr) return nullptr;
    map_.load(*kept, shown_);
    return &shown_;
  }

  std::size_t bytes() const {
    return map_.bytes_in_use() + point_words_.bytes_in_use() + line_words_.bytes_in_use();
  }
  std::size_t capacity_bytes() const { return capacity_.bytes; }

 private:
  // What frames will need, so that none of them allocates.
  void reserve() {
    const auto points = static_cast<std::size_t>(config_.features.points);
    const auto lines = static_cast<std::size_t>(config_.features.lines);
    for (Verifier* verifier : {&point_lane_, &line_lane_}) verifier->reserve(points, lines);
    trials_.resize(static_cast<std::size_t>(config_.loop.verified_islands) *
                   static_cast<std::size_t>(config_.loop.verified_images));
    for (Trial& trial : trials_) {
      reserve(trial.features, points, lines);
      trial.matches.points.reserve(points);
      trial.matches.lines.reserve(lines);
    }
    for (Features* features : {&features_, &newest_features_, &shown_, &admitted_})
      reserve(*features, points, lines);
    for (ImageWords* words : {&admitted_words_, &leaving_}) words->resize(points, lines);
    for (auto* candidates : {&points_, &lines_}) candidates->reserve(capacity_.images);
    checked_.reserve(trials_.size());
  }

  static void reserve(Features& features, std::size_t points, std::size_t lines) {
    features.points.reserve(points);
    features.point_descriptors.reserve(points);
    features.lines.reserve(lines);
    features.line_descriptors.reserve(lines);
  }

  // One candidate of this frame and what its verification found.
  struct Trial {
    Island island;
    Candidate candidate;
    Features features;
    ImageMatches matches;
    Verification found;
    InlierPairs pairs;
  };

  // The word numbers of one image.
  struct ImageWords {
    std::vector<WordId> points;
    std::vector<WordId> lines;
    void resize(std::size_t point_count, std::size_t line_count) {
      points.resize(point_count);
      lines.resize(line_count);
    }
  };

  static void forget_evidence(Report& report) {
    report.point_candidates.clear();
    report.line_candidates.clear();
    report.fused.clear();
    report.island.reset();
    report.match.reset();
    report.verification.reset();
    report.pairs.clear();
  }

  // 1
  void describe(const LumaView& image) {
    extractor_.prepare(image, features_);
    lanes_.run([this] { extractor_.extract_points(features_); },
               [this] { extractor_.extract_lines(features_); });
  }

  // The method, a step a line (numbers as in DESIGN section 3; 1 came before, 8 follows in absorb).
  Outcome decide(Report& report) {
    report.points = static_cast<int>(features_.points.size());
    report.lines = static_cast<int>(features_.lines.size());
    if (report.points + report.lines < config_.features.min_features) return Outcome::kNoFeatures;
    notice_motion(report);
    if (map_.searchable() == 0) return Outcome::kMapEmpty;
    search(report);                                                // 2
    normalise(report);                                             // 3
    fuse(points_, lines_, config_.loop.one_list_penalty, fused_);  // 4
    copy_head(fused_, report.fused);
    find_islands();  // 5
    if (islands_.empty()) return Outcome::kNoCandidates;
    return verify(report);  // 6, 7
  }

  // A frame that shows what the last kept image shows adds nothing to the map. And the waiting
  // window's clock stops while the camera is parked, so that a parked robot closes no loop with
  // itself: a still frame counts only if a moving one paid for it (a slow hand stands still at
  // times, too).
  void notice_motion(Report& report) {
    const MapImage* newest = map_.newest();
    report.still = newest != nullptr && stillness_.is_still(newest_features_, features_);
    pending_ = !report.still;

    const std::int64_t elapsed_ns = time_under_way(last_time_ns_, report.time_ns);
    last_time_ns_ = report.time_ns;
    const int most = std::min(kMaxStillCredit, config_.loop.waiting_frames / 2);
    still_credit_ = std::min(most, still_credit_ + (report.still ? -1 : 1));
    if (still_credit_ < 0) {
      still_credit_ = 0;
      return;
    }
    ++clock_.frames;
    clock_.ns += elapsed_ns;
  }

  void search(Report& report) {
    const StageTimer timer(report.times.search_ns);
    lanes_.run([this] { point_words_.search(features_.point_descriptors, points_); },
               [this] { line_words_.search(features_.line_descriptors, lines_); });
  }

  void normalise(Report& report) {
    const auto longest = static_cast<std::size_t>(config_.loop.max_candidates);
    normalise_scores(points_, config_.loop.min_similarity, longest);
    normalise_scores(lines_, config_.loop.min_similarity, longest);
    copy_head(points_, report.point_candidates);
    copy_head(lines_, report.line_candidates);
  }

  // Priority only orders: an island that overlaps the one verified for the previous image comes
  // first.
  void find_islands() {
    placed_.clear();
    for (const Candidate& c : fused_) placed_.push_back({c.image, map_.position(c.image), c.score});
    island_builder_.build(placed_, static_cast<std::uint32_t>(config_.loop.island_gap), islands_);
    prefer_island(islands_, priority_);
    const auto most = static_cast<std::size_t>(config_.loop.verified_islands);
    if (islands_.size() > most) islands_.resize(most);
  }

  // The most convincing of the best images of the best islands. One image of one island (the
  // paper's way) picks the most similar view, which is often not the one that shares the most of
  // the scene.
  Outcome verify(Report& report) {
    const StageTimer timer(report.times.verify_ns);
    const std::uint64_t seed = seed_of(report.query);
    list_trials();
    lanes_.run([&] { match_trials(0, point_lane_); }, [&] { match_trials(1, line_lane_); });
    choose_trials();
    lanes_.run([&] { check_trials(0, seed, point_lane_); },
               [&] { check_trials(1, seed, line_lane_); });
    const Trial& best = *most_convincing();
    const MapImage& image = *map_.find(best.candidate.image);
    report.island = best.island;
    report.match = Match{image.id, image.sequence, image.time_ns, best.candidate.score};
    report.verification = best.found;
    report.pairs = best.pairs;
    return judge(best.found);
  }

  // What is verified for this frame: the best images of the best islands, in that order.
  void list_trials() {
    trial_count_ = 0;
    for (const Island& island : islands_) {
      int left = config_.loop.verified_images;
      for (const Candidate& c : fused_) {
        if (c.image < island.first || c.image > island.last) continue;
        if (left-- == 0) break;
        trials_[trial_count_].island = island;
        trials_[trial_count_++].candidate = c;
      }
    }
  }

  // Every second trial, so that two lanes share the work; each is independent of all others.
  void match_trials(std::size_t first, Verifier& verifier) {
    for (std::size_t i = first; i < trial_count_; i += 2) {
      Trial& trial = trials_[i];
      map_.load(*map_.find(trial.candidate.image), trial.features);
      verifier.match(features_, trial.features, trial.matches);
    }
  }

  // The most promising, in the order of the trials among equals.
  void choose_trials() {
    checked_.clear();
    for (std::size_t i = 0; i < trial_count_; ++i) checked_.push_back(i);
    std::sort(checked_.begin(), checked_.end(), [this](std::size_t a, std::size_t b) {
      const double of_a = trials_[a].matches.promise, of_b = trials_[b].matches.promise;
      return of_a != of_b ? of_a > of_b : a < b;
    });
    const auto most = static_cast<std::size_t>(config_.loop.checked_images);
    if (checked_.size() > most) checked_.resize(most);
  }

  void check_trials(std::size_t first, std::uint64_t seed, Verifier& verifier) {
    for (std::size_t i = first; i < checked_.size(); i += 2) {
      Trial& trial = trials_[checked_[i]];
      trial.found = verifier.check(features_, trial.features, trial.matches, seed, trial.pairs);
    }
  }

  const Trial* most_convincing() const {
    const Trial* best = nullptr;
    for (const std::size_t i : checked_)
      if (best == nullptr || conviction(trials_[i].found) > conviction(best->found))
        best = &trials_[i];
    return best;
  }

  Outcome judge(const Verification& found) const {
    if (found.matches() < config_.verify.min_inliers) return Outcome::kFewMatches;
    if (found.inliers() < config_.verify.min_inliers) return Outcome::kFewInliers;
    if (found.agreeing < config_.verify.min_agreement * found.matches())
      return Outcome::kContradicted;
    return Outcome::kLoop;
  }

  std::uint64_t seed_of(ImageId query) const {
    return (static_cast<std::uint64_t>(config_.verify.seed) << 32U) + query;
  }

  // Keeps the newest frame in the waiting window. It is given up if its room cannot be made in the
  // time a frame has.
  void keep(const Report& report) {
    for (int i = 0; i < kMaxEvictions && !map_.has_room(features_); ++i)
      if (!make_room()) break;
    if (!map_.has_room(features_)) {
      ++evictions_.not_kept;
      return;
    }
    MapImage image;
    image.id = report.query;
    image.sequence = report.sequence;
    image.time_ns = report.time_ns;
    image.taken = clock_;
    image.revisit = report.outcome == Outcome::kLoop;
    map_.push(image, features_);
    newest_features_ = features_;
    if (image.revisit && map_.find(report.match->image) != nullptr)
      map_.note_revisit(report.match->image);
  }

  // Where frames come fast, a waiting window of many seconds holds more of one place than the map
  // has room for: then every second one of it must do.
  bool make_room() {
    if (!map_.crowded_by_waiting() || !map_.thin_waiting()) return evict(evictions_.for_images);
    ++evictions_.waiting;
    return true;
  }

  // Forgets the searchable image worth least.
  bool evict(std::uint64_t& reason) {
    const auto position = least_worth(map_.searchable_images());
    if (!position) return false;
    const MapImage& image = map_.at(*position);
    leaving_.resize(image.points, image.lines);
    map_.load_words(image, leaving_.points, leaving_.lines);
    point_words_.remove(image.id, leaving_.points);
    line_words_.remove(image.id, leaving_.lines);
    map_.remove(*position);
    ++reason;
    return true;
  }

  // 8. At most two images a frame, so that a frame's time stays bounded after a pause.
  void admit_ready() {
    const WaitingClock next{clock_.frames + 1, clock_.ns};
    for (int i = 0; i < 2 && map_.ready(next) != nullptr; ++i) admit(*map_.ready(next));
  }

  // The image's features become words, which makes it searchable; words that were new a while ago
  // and are still its own alone are deleted.
  void admit(const MapImage& waiting) {
    const ImageId id = waiting.id;
    map_.load(waiting, admitted_);
    for (int i = 0; i < kMaxEvictions && !words_have_room(admitted_); ++i)
      if (!evict(evictions_.for_words)) break;
    admitted_words_.resize(admitted_.points.size(), admitted_.lines.size());
    lanes_.run(
        [&] {
          add_once(point_words_, id, admitted_.point_descriptors, admitted_words_.points,
                   in_points_);
        },
        [&] {
          add_once(line_words_, id, admitted_.line_descriptors, admitted_words_.lines, in_lines_);
        });
    const auto features = static_cast<double>(admitted_.points.size() + admitted_.lines.size());
    const auto shared = static_cast<double>(in_points_.shared + in_lines_.shared);
    map_.admit(1 - shared / features);
    const MapImage& image = *map_.find(id);
    map_.store_words(image, admitted_words_.points, admitted_words_.lines);
    end_probation();
  }

  bool words_have_room(const Features& features) const {
    return point_words_.has_room(features.points.size()) &&
           line_words_.has_room(features.lines.size());
  }

  void end_probation() {
    const auto probation = static_cast<std::size_t>(config_.index.probation_images);
    if (probation == 0 || map_.searchable() <= probation) return;
    const MapImage& image = map_.at(map_.searchable() - 1 - probation);
    leaving_.resize(image.points, image.lines);
    map_.load_words(image, leaving_.points, leaving_.lines);
    point_words_.end_probation(image.id, leaving_.points);
    line_words_.end_probation(image.id, leaving_.lines);
    map_.store_words(image, leaving_.points, leaving_.lines);
  }

  // The newest image of a vocabulary.
  struct Newest {
    std::optional<ImageId> image;
    std::size_t shared = 0;  // of its descriptors, with the image before
  };

  // If one lane fails, the image waits and the next attempt adds it only where it is missing.
  static void add_once(Vocabulary& words, ImageId image, std::span<const Descriptor> descriptors,
                       std::span<WordId> numbers, Newest& newest) {
    if (newest.image == image) return;
    newest.shared = words.add(image, descriptors, numbers);
    newest.image = image;
  }

  Config config_;
  InlineLanes inline_lanes_;
  LaneExecutor& lanes_;
  FeatureExtractor extractor_;
  const MapLayout capacity_;
  Vocabulary point_words_;
  Vocabulary line_words_;
  Verifier point_lane_;
  Verifier line_lane_;
  StillnessTest stillness_;
  ImageMap map_;

  ImageId next_id_ = 0;
  Features features_;         // of the newest frame
  Features newest_features_;  // of the newest image kept
  Features shown_;            // what features() was asked for
  Features admitted_;         // of the image that becomes searchable, and its words
  ImageWords admitted_words_;
  ImageWords leaving_;  // words of an image that is evicted or whose probation ends
  Evictions evictions_;
  bool pending_ = false;  // the newest frame waits for absorb() to keep it
  std::optional<std::int64_t> last_time_ns_;
  Newest in_points_;
  Newest in_lines_;
  int still_credit_ = 0;
  WaitingClock clock_;
  std::optional<Island> priority_;
  std::vector<Candidate> points_;
  std::vector<Candidate> lines_;
  std::vector<Candidate> fused_;
  std::vector<PlacedCandidate> placed_;
  IslandBuilder island_builder_;
  std::vector<Island> islands_;
  std::vector<Trial> trials_;  // the first trial_count_ are this frame's
  std::size_t trial_count_ = 0;
  std::vector<std::size_t> checked_;  // trials whose geometry is checked
};

Detector::Detector(const Config& config, LaneExecutor* lanes)
    : config_(config), lanes_(lanes), impl_(std::make_unique<Impl>(config, lanes)) {}
Detector::~Detector() = default;

void Detector::clear() {
  impl_.reset();  // before the new one is made: never the memory of two maps
  impl_ = std::make_unique<Impl>(config_, lanes_);
}

void Detector::process(const Frame& frame, Report& report) { impl_->process(frame, report); }
void Detector::process(const Features& features, std::uint64_t sequence,
                       std::optional<std::int64_t> time_ns, Report& report) {
  impl_->process(features, sequence, time_ns, report);
}
void Detector::absorb(Report& report) { impl_->absorb(report); }
const Features* Detector::features(ImageId image) { return impl_->features(image); }
std::size_t Detector::bytes() const { return impl_->bytes(); }
std::size_t Detector::capacity_bytes() const { return impl_->capacity_bytes(); }

}  // namespace loopd
