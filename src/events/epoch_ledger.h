#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "base/unique_fd.h"
#include "events/records.h"

namespace loopd {

/// How far the stream of records went in the last epochs, and of which class the newest 65,536
/// records were, so that a client can be told what it missed, also across a restart of the daemon.
/// It is no store of records: those are gone.
///
/// With a file it survives the process, however that ends: each change is written in place by
/// pwrite(), in an order that leaves the file valid after any of them. (Not by a mapping: a store
/// into one whose file was cut short, or whose file system is full, is a fatal signal.)
///
/// Records are counted from 0 over all epochs by an `index`; within an epoch, it and the seq grow
/// together. Thread: one owner at a time. Cost of add(): two writes of 1 and 8 bytes.
class EpochLedger {
 public:
  /// What is known of epochs before the oldest is forgotten.
  static constexpr std::size_t kEpochs = 15;
  static constexpr std::size_t kRecords = 65'536;
  static constexpr std::size_t kMaxNameBytes = 63;

  /// In memory only.
  EpochLedger();
  EpochLedger(EpochLedger&&) noexcept;
  EpochLedger& operator=(EpochLedger&&) noexcept;
  ~EpochLedger();

  struct Opened;
  /// Reads the file at `path`, or makes it (mode 0600). Never fails: without a usable file the
  /// ledger is in memory only, with a damaged one it starts anew, and the warning says so.
  static Opened open(const std::string& path);

  /// From now on records belong to the epoch `name`, the first with `first_seq`.
  void begin_epoch(std::string_view name, std::uint64_t first_seq);
  /// One record more was published. Precondition: an epoch has begun.
  void add(RecordClass record_class);

  /// The index of the record after the one that `since` names; none if its epoch is not known or
  /// had no such record. (seq first_seq - 1: the index of the epoch's first.)
  std::optional<std::uint64_t> index_after(const Since& since) const;
  /// The last seq of a known epoch; first_seq - 1 if it had no record.
  std::optional<std::uint64_t> last_seq(std::string_view epoch) const;
  /// Index and seq of the first record of the current epoch.
  std::uint64_t epoch_index() const;
  std::uint64_t epoch_first_seq() const;
  std::uint64_t next_index() const;
  /// How many records from index `from` up to, not including, `to` are of `classes`; none if that
  /// is too long ago. Precondition: from <= to <= next_index().
  std::optional<std::uint64_t> count(std::uint64_t from, std::uint64_t to, ClassSet classes) const;

  /// Whether there is a file that is up to date.
  bool has_file() const { return file_.valid(); }

 private:
  struct Epoch {
    std::array<char, kMaxNameBytes + 1> name;  ///< ends with NULs; all NULs: one with a longer name
    std::uint64_t first_seq;
    std::uint64_t first_index;
  };
  /// The file, in the byte order of the machine. One slot more than there are epochs: the one
  /// being written is not yet, or no longer, valid.
  struct Image {
    std::array<char, 8> magic;
    std::uint64_t epochs;   ///< begun ever; the newest is in slot (epochs - 1) % (kEpochs + 1)
    std::uint64_t records;  ///< added ever
    std::array<Epoch, kEpochs + 1> slots;
    std::array<std::uint8_t, kRecords> classes;  ///< of record i: at i % kRecords
  };

  static std::unique_ptr<Image> empty_image();
  static bool is_valid(const Image& image);
  static const Epoch& slot(const Image& image, std::uint64_t epoch) {
    return image.slots[static_cast<std::size_t>(epoch % (kEpochs + 1))];
  }
  static std::uint64_t oldest_epoch(const Image& image) {
    return image.epochs > kEpochs ? image.epochs - kEpochs : 0;
  }
  static std::uint64_t end_index(const Image& image, std::uint64_t epoch);
  std::string adopt_file(UniqueFd fd);
  std::optional<std::uint64_t> find(std::string_view name) const;
  void write(const void* part, std::size_t bytes);

  std::unique_ptr<Image> image_;  ///< what the file holds
  UniqueFd file_;                 ///< locked; none: in memory only
};

struct EpochLedger::Opened {
  EpochLedger ledger;
  std::string warning;  ///< one sentence; empty if all is well
};

}  // namespace loopd
