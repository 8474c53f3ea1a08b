// Once it has seen what there is to see, the detector allocates nothing, whatever a frame leads to.
// A program of its own, since it counts every allocation of the process.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <vector>

#include "base/lanes.h"
#include "loop/detector_run.h"
#include "loopd/capacity.h"
#include "support/feature_walk.h"

namespace {

std::atomic<bool> counting{false};
std::atomic<std::uint64_t> allocations{0};

void* counted(std::size_t bytes, std::size_t alignment) {
  if (counting) ++allocations;
  void* const memory =
      std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t bytes) { return counted(bytes, alignof(std::max_align_t)); }
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  return counted(bytes, static_cast<std::size_t>(alignment));
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace loopd {
namespace {

using testing::Image;
using testing::laps_of;
using testing::small_config;
using testing::TestRun;
using testing::walk;

/// Allocations while it lives.
class Count {
 public:
  Count() {
    allocations = 0;
    counting = true;
  }
  ~Count() { counting = false; }
  std::uint64_t so_far() const { return allocations; }
};

TEST(Allocations, AreSeenByTheCounter) {
  const Count count;
  std::vector<int> one(10);
  EXPECT_EQ(count.so_far(), 1u);
}

// Images of a few laps again and again, with loops, in a map that is full.
TEST(Allocations, ThereAreNoneForImagesAfterWarmUp) {
  auto lanes = TwoLanes::start({.name = "lines"});
  ASSERT_TRUE(lanes);
  Config config = small_config();
  config.memory_budget_bytes = static_cast<std::int64_t>(least_map_bytes(config));
  TestRun run(config, lanes.value().get());
  std::vector<Frame> frames;
  for (const Image& image : laps_of(walk(40), 3)) frames.push_back(image.frame(0, std::nullopt));
  std::uint64_t loops = 0;
  const auto see = [&](std::size_t i) {
    Frame& frame = frames[i % frames.size()];
    frame.sequence = i;
    run.detector.process(frame, run.report());
    run.absorb();
    loops += run.report().outcome == Outcome::kLoop ? 1 : 0;
  };
  std::size_t i = 0;
  while (i < 4 * frames.size()) see(i++);
  loops = 0;
  const Evictions before = run.report().evictions;
  {
    const Count count;
    for (int n = 0; n < 1000; ++n) {
      see(i++);
      ASSERT_EQ(count.so_far(), 0u) << "frame " << i << ", " << n << " after the warm-up";
    }
  }
  EXPECT_GT(loops, 100u);
  EXPECT_NE(run.report().evictions, before) << "the map was not full";
}

}  // namespace
}  // namespace loopd
