// The recording thread: limits, slow, full and broken disks, and what it says in the end.

#include "capture/recording_writer.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <limits>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "capture/recording_reader.h"
#include "capture/recording_tap.h"
#include "support/recording_file.h"
#include "support/temp_dir.h"

namespace loopd {
namespace {

using ::testing::HasSubstr;
using testing::make_shot;
using testing::Shot;
using testing::TempDir;

// A disk in memory that does what the test says. Thread-safe.
struct Disk {
  std::mutex mutex = {};
  std::condition_variable changed = {};
  std::string bytes = {};
  int appends = 0;
  bool open = true;          ///< else append() waits
  int fails_from = 1 << 30;  ///< the append, from 0, that fails
  int append_error = 0;
  int finish_error = 0;
  int finished = 0;

  void let_through() {
    const std::lock_guard lock(mutex);
    open = true;
    changed.notify_all();
  }
  void wait_for_appends(int count) {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return appends >= count; });
  }
};

class DiskOutput : public RecordingOutput {
 public:
  explicit DiskOutput(Disk& disk) : disk_(&disk) {}

  Status append(std::span<const std::uint8_t> bytes) override {
    std::unique_lock lock(disk_->mutex);
    disk_->changed.wait(lock, [this] { return disk_->open; });
    if (disk_->appends >= disk_->fails_from) return errno_error("append", disk_->append_error);
    disk_->bytes.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    ++disk_->appends;
    disk_->changed.notify_all();
    return Nothing{};
  }

  Status finish() override {
    const std::lock_guard lock(disk_->mutex);
    ++disk_->finished;
    if (disk_->finish_error != 0) return errno_error("finish", disk_->finish_error);
    return Nothing{};
  }

 private:
  Disk* disk_;
};

using WriterPtr = std::unique_ptr<RecordingWriter>;

class RecordingWriterTest : public ::testing::Test {
 protected:
  std::string path() const { return (dir_ / "recording").string(); }

  UniqueFd new_file(int flags = O_WRONLY | O_CREAT | O_TRUNC) const {
    return UniqueFd(::open(path().c_str(), flags | O_CLOEXEC, 0600));
  }

  static WriterPtr started(Result<WriterPtr> writer) {
    if (!writer.ok()) throw std::runtime_error(writer.error().message);
    return std::move(writer).value();
  }

  // With a small default buffer, and nothing kept free: the disk of the machine is not the test's.
  static RecordingOptions with(RecordingLimits limits, std::size_t buffer_bytes = 1u << 20) {
    limits.keep_free_bytes = 0;
    return {.camera = "front",
            .loopd_version = "1.2.3",
            .boot_id = "boot",
            .limits = limits,
            .buffer_bytes = buffer_bytes};
  }

  static void offer(RecordingWriter& writer, const Shot& shot) {
    writer.offer(shot.view(), shot.sequence, shot.time_ns);
  }

  static bool ended(const RecordingWriter& writer, int timeout_ms) {
    pollfd fd{writer.finished_fd(), POLLIN, 0};
    return ::poll(&fd, 1, timeout_ms) == 1;
  }

  static RecordingResult end_of(const RecordingWriter& writer) {
    EXPECT_TRUE(ended(writer, -1));
    return writer.result();
  }

  // What playback would find, one after the other.
  std::vector<RecordedFrame> recorded() const { return recorded(path()); }
  static std::vector<RecordedFrame> recorded(const std::string& path) {
    auto reader = RecordingReader::open(path, {});
    EXPECT_TRUE(reader.ok()) << reader.error().message;
    std::vector<RecordedFrame> frames;
    while (reader.ok()) {
      const auto next = reader->next();
      if (!next.ok() || !next.value()) break;
      std::vector<std::uint8_t> luma(next.value()->size.pixels());
      EXPECT_TRUE(reader->read_pixels(luma).ok());
      frames.push_back(*next.value());
    }
    return frames;
  }
  std::vector<RecordedFrame> recorded(Disk& disk) const {
    return recorded(dir_.write("disk", disk.bytes).string());
  }

  TempDir dir_;
};

TEST_F(RecordingWriterTest, WritesWhatItIsOfferedAndSaysSo) {
  const WriterPtr writer = started(RecordingWriter::start(new_file(), with({})));
  EXPECT_FALSE(writer->result().end);
  for (std::uint64_t i = 0; i < 20; ++i)
    offer(*writer, make_shot(31, 17, 100 + 2 * i, static_cast<std::int64_t>(i)));
  writer->stop();
  const RecordingResult result = end_of(*writer);
  EXPECT_EQ(result.end, RecordingEnd::kStopped);
  EXPECT_EQ(result.frames, 20u);
  EXPECT_EQ(result.lost, 0u);
  EXPECT_EQ(result.message, "");
  EXPECT_EQ(result.bytes, std::filesystem::file_size(path()));
  const auto frames = recorded();
  ASSERT_EQ(frames.size(), 20u);
  EXPECT_EQ(frames[19].number, 19u);
  EXPECT_EQ(frames[19].sequence, 138u);
  EXPECT_EQ(frames[19].time_ns, 19);
  const RecordingInfo info = RecordingReader::open(path(), {}).value().info();
  EXPECT_EQ(info.camera + info.loopd_version + info.boot_id, "front1.2.3boot");
  EXPECT_GT(info.started_realtime_ns, info.started_monotonic_ns);
}

TEST_F(RecordingWriterTest, EndsAtTheNumberOfFrames) {
  const WriterPtr writer = started(RecordingWriter::start(new_file(), with({.frames = 3})));
  for (std::uint64_t i = 0; i < 10; ++i) offer(*writer, make_shot(4, 4, i, 0));
  EXPECT_EQ(end_of(*writer).end, RecordingEnd::kFrames);
  offer(*writer, make_shot(4, 4, 99, 0));
  EXPECT_EQ(writer->result().frames, 3u);
  EXPECT_EQ(writer->result().lost, 0u);
  EXPECT_EQ(recorded().size(), 3u);
}

TEST_F(RecordingWriterTest, NeverWritesALongerFileThanItMay) {
  for (const std::uint64_t limit : {256u, 256u + 127u, 256u + 128u, 256u + 300u}) {
    const WriterPtr writer = started(RecordingWriter::start(new_file(), with({.bytes = limit})));
    for (std::uint64_t i = 0; i < 4; ++i) offer(*writer, make_shot(8, 8, i, 0));
    const RecordingResult result = end_of(*writer);
    EXPECT_EQ(result.end, RecordingEnd::kSize);
    EXPECT_EQ(result.frames, (limit - 256) / 128);
    EXPECT_EQ(std::filesystem::file_size(path()), result.bytes);
    EXPECT_LE(result.bytes, limit);
  }
}

TEST_F(RecordingWriterTest, EndsInTimeAlsoWhenNoFrameComes) {
  const WriterPtr writer =
      started(RecordingWriter::start(new_file(), with({.duration_ns = 1'000'000})));
  EXPECT_EQ(end_of(*writer).end, RecordingEnd::kTime);
  EXPECT_TRUE(recorded().empty());
}

TEST_F(RecordingWriterTest, ASlowDiskCostsFramesThatTheNextOneCounts) {
  Disk disk{.open = false};
  const WriterPtr writer =
      started(RecordingWriter::start(std::make_unique<DiskOutput>(disk), with({}, 4 * 128)));
  for (std::uint64_t i = 0; i < 6; ++i) offer(*writer, make_shot(8, 8, i, 0));
  EXPECT_EQ(writer->result().lost, 2u);
  EXPECT_EQ(writer->result().frames, 0u);
  disk.let_through();
  disk.wait_for_appends(1 + 4);
  offer(*writer, make_shot(8, 8, 6, 0));
  writer->stop();
  const RecordingResult result = end_of(*writer);
  EXPECT_EQ(result.frames, 5u);
  EXPECT_EQ(result.lost, 2u);
  const auto frames = recorded(disk);
  ASSERT_EQ(frames.size(), 5u);
  EXPECT_EQ(frames[3].lost_before, 0u);
  EXPECT_EQ(frames[4].lost_before, 2u);
  EXPECT_EQ(frames[4].sequence, 6u);
  EXPECT_EQ(frames[4].number, 4u);
}

TEST_F(RecordingWriterTest, StopWaitsForNobodyAndWhatWasOfferedIsStillWritten) {
  Disk disk{.open = false};
  const WriterPtr writer =
      started(RecordingWriter::start(std::make_unique<DiskOutput>(disk), with({})));
  for (std::uint64_t i = 0; i < 5; ++i) offer(*writer, make_shot(8, 8, i, 0));
  writer->stop();
  EXPECT_FALSE(ended(*writer, 0));
  EXPECT_FALSE(writer->result().end);
  disk.let_through();
  EXPECT_EQ(end_of(*writer).frames, 5u);
  EXPECT_EQ(disk.finished, 1);
}

TEST_F(RecordingWriterTest, AFullDiskEndsItAndKeepsWhatIsThere) {
  for (const int code : {ENOSPC, EDQUOT, EIO, EFBIG}) {
    Disk disk{.open = false, .fails_from = 3, .append_error = code};
    const WriterPtr writer =
        started(RecordingWriter::start(std::make_unique<DiskOutput>(disk), with({})));
    for (std::uint64_t i = 0; i < 6; ++i) offer(*writer, make_shot(8, 8, i, 0));
    disk.let_through();
    const RecordingResult result = end_of(*writer);
    const bool full = code == ENOSPC || code == EDQUOT;
    EXPECT_EQ(result.end, full ? RecordingEnd::kDiskFull : RecordingEnd::kWriteError);
    EXPECT_EQ(result.code, code);
    EXPECT_EQ(result.frames, 2u);
    EXPECT_EQ(result.lost, 4u);
    EXPECT_NE(result.message, "");
    EXPECT_EQ(recorded(disk).size(), 2u);
  }
}

TEST_F(RecordingWriterTest, AFailureAtTheVeryEndIsNoSuccess) {
  Disk disk{.finish_error = EIO};
  const WriterPtr writer =
      started(RecordingWriter::start(std::make_unique<DiskOutput>(disk), with({})));
  writer->stop();
  EXPECT_EQ(end_of(*writer).end, RecordingEnd::kWriteError);
  EXPECT_EQ(writer->result().code, EIO);
}

TEST_F(RecordingWriterTest, DestroyingItEndsIt) {
  Disk disk;
  {
    const WriterPtr writer =
        started(RecordingWriter::start(std::make_unique<DiskOutput>(disk), with({})));
    offer(*writer, make_shot(8, 8, 1, 0));
  }
  EXPECT_EQ(disk.finished, 1);
  EXPECT_EQ(recorded(disk).size(), 1u);
}

// The limit of a process on the length of a file: SIGXFSZ ends a program that does not expect it.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { setrlimit(RLIMIT_FSIZE, &before_); }

 private:
  rlimit before_{};
};

TEST_F(RecordingWriterTest, TheKernelsLimitOnAFileIsAnErrorAndNoSignal) {
  const FileSizeLimit limit(10'000);
  const WriterPtr writer = started(RecordingWriter::start(new_file(), with({})));
  for (std::uint64_t i = 0; i < 10; ++i) offer(*writer, make_shot(64, 31, i, 0));
  const RecordingResult result = end_of(*writer);
  EXPECT_EQ(result.end, RecordingEnd::kWriteError);
  EXPECT_EQ(result.code, EFBIG);
  EXPECT_THAT(result.message, HasSubstr("LimitFSIZE="));
  EXPECT_EQ(result.frames, 4u);
  EXPECT_EQ(std::filesystem::file_size(path()), result.bytes);
  EXPECT_EQ(recorded().size(), 4u);
}

TEST_F(RecordingWriterTest, LeavesRoomForOthers) {
  RecordingOptions options = with({});
  options.limits.keep_free_bytes = std::numeric_limits<std::uint64_t>::max();
  const WriterPtr writer = started(RecordingWriter::start(new_file(), options));
  const RecordingResult result = end_of(*writer);
  EXPECT_EQ(result.end, RecordingEnd::kDiskFull);
  EXPECT_THAT(result.message, HasSubstr("to be kept for others"));
  EXPECT_EQ(std::filesystem::file_size(path()), 0u);
}

TEST_F(RecordingWriterTest, LargeFilesGoToTheDiskInStretches) {
  const WriterPtr writer =
      started(RecordingWriter::start(new_file(), with({.frames = 30}, std::size_t{32} << 20)));
  for (std::uint64_t i = 0; i < 30; ++i) offer(*writer, make_shot(1000, 1000, i, 0));
  EXPECT_EQ(end_of(*writer).end, RecordingEnd::kFrames);
  EXPECT_EQ(recorded().size(), 30u);
}

TEST_F(RecordingWriterTest, FilesItCannotUseAreRefused) {
  const auto error = [](UniqueFd file) {
    const auto writer = RecordingWriter::start(std::move(file), with({}));
    return writer.ok() ? "" : writer.error().message;
  };
  new_file();
  EXPECT_THAT(error(new_file(O_RDONLY)), HasSubstr("not open for writing"));
  EXPECT_THAT(error(new_file(O_PATH)), HasSubstr("not open for writing"));
  EXPECT_THAT(error(new_file(O_WRONLY | O_APPEND)), HasSubstr("O_APPEND"));
  EXPECT_THAT(error(UniqueFd()), HasSubstr("Bad file descriptor"));
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  const UniqueFd read_end(ends[0]);
  EXPECT_THAT(error(UniqueFd(ends[1])), HasSubstr("not a regular file"));
  dir_.write("recording", "precious");
  EXPECT_THAT(error(new_file(O_WRONLY)), HasSubstr("not empty"));
  EXPECT_EQ(std::filesystem::file_size(path()), 8u);
}

TEST_F(RecordingWriterTest, LimitsOutOfRangeAreListed) {
  const auto writer =
      RecordingWriter::start(new_file(), with({.duration_ns = 0, .bytes = 255, .frames = 0}, 100));
  ASSERT_FALSE(writer.ok());
  for (const char* part : {"duration", "size", "number of frames", "buffer"})
    EXPECT_THAT(writer.error().message, HasSubstr(part));
}

TEST_F(RecordingWriterTest, AThreadThatMustHaveItsCpusDoesNotRunWithoutThem) {
  RecordingOptions options = with({});
  options.thread.cpus = {100'000};
  const WriterPtr writer = started(RecordingWriter::start(new_file(), options));
  EXPECT_EQ(writer->shortfalls().size(), 1u);
  options.thread.required = true;
  EXPECT_FALSE(RecordingWriter::start(new_file(), options).ok());
}

TEST_F(RecordingWriterTest, EndsHaveStableNames) {
  EXPECT_EQ(recording_end_name(RecordingEnd::kStopped), "stopped");
  EXPECT_EQ(recording_end_name(RecordingEnd::kTime), "time");
  EXPECT_EQ(recording_end_name(RecordingEnd::kSize), "size");
  EXPECT_EQ(recording_end_name(RecordingEnd::kFrames), "frames");
  EXPECT_EQ(recording_end_name(RecordingEnd::kDiskFull), "disk_full");
  EXPECT_EQ(recording_end_name(RecordingEnd::kWriteError), "write_error");
}

TEST(RecordingTapTest, HandsFramesToTheWriterOfTheMoment) {
  const Shot shot = make_shot(8, 8, 3, 5);
  const Frame frame = copy_to_frame(shot.view(), shot.sequence, shot.time_ns);
  RecordingTap tap;
  tap.offer(frame);
  Disk disk;
  auto writer = RecordingWriter::start(std::make_unique<DiskOutput>(disk), {});
  ASSERT_TRUE(writer.ok());
  tap.start(*writer.value());
  tap.offer(frame);
  tap.stop();
  tap.offer(frame);
  writer.value().reset();
  EXPECT_EQ(disk.appends, 2);
}

TEST(RecordingTapTest, WritersComeAndGoWhileFramesFlow) {
  const Shot shot = make_shot(8, 8, 3, 5);
  const Frame frame = copy_to_frame(shot.view(), shot.sequence, shot.time_ns);
  RecordingTap tap;
  std::atomic<bool> done = false;
  std::thread capture([&] {
    while (!done) tap.offer(frame);
  });
  for (int i = 0; i < 20; ++i) {
    Disk disk;
    auto writer =
        RecordingWriter::start(std::make_unique<DiskOutput>(disk), {.buffer_bytes = 4096});
    ASSERT_TRUE(writer.ok());
    tap.start(*writer.value());
    disk.wait_for_appends(1 + 3);
    tap.stop();
    writer.value()->stop();
    writer.value().reset();
    EXPECT_EQ(disk.finished, 1);
  }
  done = true;
  capture.join();
}

}  // namespace
}  // namespace loopd
