#include "events/epoch_ledger.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <type_traits>
#include <utility>

#include "base/result.h"

namespace loopd {

namespace {

constexpr std::array<char, 8> kMagic = {'l', 'o', 'o', 'p', 'd', 'L', 'g', '1'};
/// No daemon gets that far; beyond it sums could wrap.
constexpr std::uint64_t kMaxNumber = std::uint64_t{1} << 62;

/// "cannot ...: why" for what stands in the way of keeping a ledger.
std::string trouble(const std::string& path, const std::string& why) {
  return "clients will not be told what they miss over a restart: cannot use the ledger \"" + path +
         "\": " + why;
}

/// Opens and locks the file; a reason if that cannot be.
Result<UniqueFd> open_file(const std::string& path) {
  constexpr int kFlags = O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  UniqueFd fd(open(path.c_str(), kFlags, 0600));
  struct stat file;
  if (!fd.valid() || fstat(fd.get(), &file) != 0) return Error{strerror(errno), errno};
  if (!S_ISREG(file.st_mode)) return Error{"it is not a regular file; move it away", EINVAL};
  if (file.st_uid != geteuid()) return Error{"it belongs to another user; remove it", EPERM};
  if (flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
    return Error{"another process uses it", EWOULDBLOCK};
  }
  return fd;
}

bool write_all(int fd, const void* bytes, std::size_t count, std::size_t offset) {
  const char* from = static_cast<const char*>(bytes);
  while (count > 0) {
    const ssize_t n = pwrite(fd, from, count, static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    from += n;
    offset += static_cast<std::size_t>(n);
    count -= static_cast<std::size_t>(n);
  }
  return true;
}

/// How many bytes of the file's start were read; stops at `count`.
std::size_t read_start(int fd, void* bytes, std::size_t count) {
  std::size_t done = 0;
  while (done < count) {
    const ssize_t n =
        pread(fd, static_cast<char*>(bytes) + done, count - done, static_cast<off_t>(done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

std::uint64_t size_of(int fd) {
  struct stat file;
  return fstat(fd, &file) == 0 ? static_cast<std::uint64_t>(file.st_size) : 0;
}

}  // namespace

EpochLedger::EpochLedger() : image_(empty_image()) {}
EpochLedger::EpochLedger(EpochLedger&&) noexcept = default;
EpochLedger& EpochLedger::operator=(EpochLedger&&) noexcept = default;
EpochLedger::~EpochLedger() = default;

std::unique_ptr<EpochLedger::Image> EpochLedger::empty_image() {
  static_assert(std::is_trivially_copyable_v<Image>);
  static_assert(sizeof(Image) == 24 + (kEpochs + 1) * 80 + kRecords, "no padding in the file");
  auto image = std::make_unique<Image>();
  image->magic = kMagic;
  return image;
}

EpochLedger::Opened EpochLedger::open(const std::string& path) {
  Opened opened;
  Result<UniqueFd> file = open_file(path);
  if (!file) {
    opened.warning = trouble(path, file.error().message);
    return opened;
  }
  const std::string why = opened.ledger.adopt_file(std::move(file).value());
  if (!why.empty()) opened.warning = trouble(path, why);
  return opened;
}

/// Takes over what the file holds, or makes it an empty ledger; what is wrong, if anything is.
std::string EpochLedger::adopt_file(UniqueFd fd) {
  auto image = std::make_unique<Image>();
  const std::uint64_t size = size_of(fd.get());
  const bool whole =
      size == sizeof(Image) && read_start(fd.get(), image.get(), sizeof(Image)) == sizeof(Image);
  const bool valid = whole && is_valid(*image);
  if (valid) {
    image_ = std::move(image);
  } else if (ftruncate(fd.get(), 0) != 0 || !write_all(fd.get(), image_.get(), sizeof(Image), 0)) {
    return strerror(errno);
  }
  file_ = std::move(fd);
  return valid || size == 0 ? "" : "it is damaged and was begun anew";
}

/// Whatever passes leaves no sum that wraps, no index out of range and no epoch that ends before
/// it begins; the classes are looked at when they are counted.
bool EpochLedger::is_valid(const Image& image) {
  if (image.magic != kMagic || image.epochs > kMaxNumber || image.records > kMaxNumber) {
    return false;
  }
  if (image.epochs == 0) return image.records == 0;
  for (std::uint64_t i = oldest_epoch(image); i < image.epochs; ++i) {
    const Epoch& epoch = slot(image, i);
    if (epoch.name.back() != '\0') return false;
    if (epoch.first_seq == 0 || epoch.first_seq > kMaxNumber) return false;
    if (epoch.first_index > end_index(image, i)) return false;
  }
  return image.records <= kMaxNumber;
}

std::uint64_t EpochLedger::end_index(const Image& image, std::uint64_t epoch) {
  return epoch + 1 < image.epochs ? slot(image, epoch + 1).first_index : image.records;
}

void EpochLedger::begin_epoch(std::string_view name, std::uint64_t first_seq) {
  Epoch epoch{{}, first_seq, image_->records};
  if (name.size() <= kMaxNameBytes) std::copy(name.begin(), name.end(), epoch.name.begin());
  Epoch& place = image_->slots[static_cast<std::size_t>(image_->epochs % (kEpochs + 1))];
  place = epoch;
  write(&place, sizeof(place));
  ++image_->epochs;
  write(&image_->epochs, sizeof(image_->epochs));
}

void EpochLedger::add(RecordClass record_class) {
  assert(image_->epochs > 0);
  std::uint8_t& place = image_->classes[static_cast<std::size_t>(image_->records % kRecords)];
  place = static_cast<std::uint8_t>(record_class);
  write(&place, sizeof(place));
  ++image_->records;
  write(&image_->records, sizeof(image_->records));
}

/// Writes a part of *image_ to its place in the file. A file that cannot be kept up to date would
/// tell clients that they have missed less than they have, so it is emptied and given up.
void EpochLedger::write(const void* part, std::size_t bytes) {
  if (!file_.valid()) return;
  const char* base = reinterpret_cast<const char*>(image_.get());
  const auto offset = static_cast<std::size_t>(static_cast<const char*>(part) - base);
  if (write_all(file_.get(), part, bytes, offset)) return;
  (void)!ftruncate(file_.get(), 0);
  file_.reset();
}

std::optional<std::uint64_t> EpochLedger::find(std::string_view name) const {
  if (name.empty() || name.size() > kMaxNameBytes) return std::nullopt;
  for (std::uint64_t i = image_->epochs; i > oldest_epoch(*image_); --i) {
    if (name == slot(*image_, i - 1).name.data()) return i - 1;
  }
  return std::nullopt;
}

std::optional<std::uint64_t> EpochLedger::index_after(const Since& since) const {
  const std::optional<std::uint64_t> found = find(since.epoch);
  if (!found) return std::nullopt;
  const Epoch& epoch = slot(*image_, *found);
  const std::uint64_t records = end_index(*image_, *found) - epoch.first_index;
  const bool known = since.seq >= epoch.first_seq - 1 && since.seq < epoch.first_seq + records;
  if (!known) return std::nullopt;
  return epoch.first_index + (since.seq + 1 - epoch.first_seq);
}

std::optional<std::uint64_t> EpochLedger::last_seq(std::string_view name) const {
  const std::optional<std::uint64_t> found = find(name);
  if (!found) return std::nullopt;
  const Epoch& epoch = slot(*image_, *found);
  return epoch.first_seq - 1 + end_index(*image_, *found) - epoch.first_index;
}

std::uint64_t EpochLedger::epoch_index() const {
  assert(image_->epochs > 0);
  return slot(*image_, image_->epochs - 1).first_index;
}

std::uint64_t EpochLedger::epoch_first_seq() const {
  assert(image_->epochs > 0);
  return slot(*image_, image_->epochs - 1).first_seq;
}

std::uint64_t EpochLedger::next_index() const { return image_->records; }

std::optional<std::uint64_t> EpochLedger::count(std::uint64_t from, std::uint64_t to,
                                                ClassSet classes) const {
  assert(from <= to && to <= image_->records);
  if (from < to && image_->records - from > kRecords) return std::nullopt;
  std::uint64_t count = 0;
  for (std::uint64_t i = from; i < to; ++i) {
    const std::uint8_t record_class = image_->classes[static_cast<std::size_t>(i % kRecords)];
    if (record_class >= kRecordClasses) return std::nullopt;  // damaged
    if (classes.has(static_cast<RecordClass>(record_class))) ++count;
  }
  return count;
}

}  // namespace loopd
