#include "capture/recording_output.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <utility>

#include "base/clock.h"

namespace loopd {
namespace {

constexpr std::uint64_t kSendBytes = 8u << 20;
constexpr std::int64_t kSendInterval_ns = 1'000'000'000;

Error write_error(int code) {
  Error error = errno_error("cannot write the recording", code);
  if (code == ENOSPC || code == EDQUOT) error.message += "; free some space or record less";
  if (code == EFBIG)
    error.message += "; the file system or LimitFSIZE= of the service allows no longer file";
  return error;
}

// What says that data did not reach the disk; the rest only says that this file cannot be synced.
bool is_data_loss(int code) { return code == EIO || code == ENOSPC || code == EDQUOT; }

class FileOutput : public RecordingOutput {
 public:
  FileOutput(UniqueFd file, std::uint64_t keep_free_bytes)
      : file_(std::move(file)), keep_free_bytes_(keep_free_bytes) {}

  Status append(std::span<const std::uint8_t> bytes) override {
    if (const Status checked = check_free(bytes.size()); !checked.ok()) return checked;
    if (const int code = write_fully(bytes); code != 0) {
      // A part of a frame is of no use; a failure here only leaves it there.
      [[maybe_unused]] const int cut = ::ftruncate(file_.get(), static_cast<off_t>(end_));
      return write_error(code);
    }
    end_ += bytes.size();
    return send_now_and_then();
  }

  Status finish() override {
    if (::fdatasync(file_.get()) != 0 && is_data_loss(errno)) return write_error(errno);
    ::posix_fadvise(file_.get(), 0, 0, POSIX_FADV_DONTNEED);
    return Nothing{};
  }

 private:
  int write_fully(std::span<const std::uint8_t> bytes) const {
    for (std::size_t done = 0; done < bytes.size();) {
      const ssize_t put = ::pwrite(file_.get(), bytes.data() + done, bytes.size() - done,
                                   static_cast<off_t>(end_ + done));
      if (put < 0 && errno == EINTR) continue;
      if (put < 0) return errno;
      if (put == 0) return EIO;
      done += static_cast<std::size_t>(put);
    }
    return 0;
  }

  // Asks the file system once for each stretch sent to it, and counts in between.
  Status check_free(std::size_t bytes) {
    if (keep_free_bytes_ == 0) return Nothing{};
    if (!free_known_) {
      struct statvfs status {};
      if (::fstatvfs(file_.get(), &status) != 0) return write_error(errno);
      free_bytes_ = static_cast<std::uint64_t>(status.f_bavail) * status.f_frsize;
      free_known_ = true;
    }
    if (free_bytes_ < bytes || free_bytes_ - bytes < keep_free_bytes_)
      return Error{"cannot write the recording: less than the " +
                       std::to_string(keep_free_bytes_ >> 20) +
                       " MiB to be kept for others would be left on the disk; free some space or "
                       "record less",
                   ENOSPC};
    free_bytes_ -= bytes;
    return Nothing{};
  }

  Status send_now_and_then() {
    const std::int64_t now_ns = monotonic_now_ns();
    if (end_ - sent_ < kSendBytes && now_ns - sent_at_ns_ < kSendInterval_ns) return Nothing{};
    sent_at_ns_ = now_ns;
    free_known_ = false;
    if (!sync_range(sent_, end_, SYNC_FILE_RANGE_WRITE)) return write_error(errno);
    constexpr unsigned kWait =
        SYNC_FILE_RANGE_WAIT_BEFORE | SYNC_FILE_RANGE_WRITE | SYNC_FILE_RANGE_WAIT_AFTER;
    if (!sync_range(arrived_, sent_, kWait)) return write_error(errno);
    ::posix_fadvise(file_.get(), static_cast<off_t>(arrived_), static_cast<off_t>(sent_ - arrived_),
                    POSIX_FADV_DONTNEED);
    arrived_ = sent_;
    sent_ = end_;
    return Nothing{};
  }

  bool sync_range(std::uint64_t from, std::uint64_t to, unsigned how) const {
    if (from == to) return true;  // a length of 0 would mean the whole file
    return ::sync_file_range(file_.get(), static_cast<off_t>(from), static_cast<off_t>(to - from),
                             how) == 0 ||
           !is_data_loss(errno);
  }

  const UniqueFd file_;
  const std::uint64_t keep_free_bytes_;
  std::uint64_t end_ = 0;      ///< of what was written
  std::uint64_t sent_ = 0;     ///< end of what the disk was asked to write
  std::uint64_t arrived_ = 0;  ///< end of what the disk has
  std::int64_t sent_at_ns_ = 0;
  bool free_known_ = false;
  std::uint64_t free_bytes_ = 0;
};

Error unusable(const std::string& why, int code) {
  return {"cannot record into this file: " + why, code};
}

}  // namespace

Result<std::unique_ptr<RecordingOutput>> open_recording_output(UniqueFd file,
                                                               std::uint64_t keep_free_bytes) {
  struct stat status {};
  const int flags = ::fcntl(file.get(), F_GETFL);
  if (flags < 0 || ::fstat(file.get(), &status) != 0)
    return errno_error("cannot record into this file", errno);
  if (!S_ISREG(status.st_mode)) return unusable("it is not a regular file", ENOTSUP);
  if ((flags & O_ACCMODE) == O_RDONLY || (flags & O_PATH) != 0)
    return unusable("it is not open for writing", EBADF);
  if ((flags & O_APPEND) != 0)
    return unusable("it is open for appending; open it without O_APPEND", EINVAL);
  if (status.st_size != 0) return unusable("it is not empty; give a new one", EEXIST);
  return std::unique_ptr<RecordingOutput>(
      std::make_unique<FileOutput>(std::move(file), keep_free_bytes));
}

}  // namespace loopd
