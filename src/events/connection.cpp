#include "events/connection.h"

#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <limits>
#include <utility>

namespace loopd {

namespace {

constexpr std::size_t kSendParts = 16;
/// What the kernel takes of a send buffer beside the packet itself.
constexpr std::size_t kPacketOverheadBytes = 64;

std::size_t send_buffer_bytes(int fd) {
  int bytes = 0;
  socklen_t size = sizeof(bytes);
  const bool known = getsockopt(fd, SOL_SOCKET, SO_SNDBUF, &bytes, &size) == 0;
  return known ? static_cast<std::size_t>(std::max(bytes, 0)) : 0;
}

}  // namespace

Connection::Connection(UniqueFd fd, Framing framing, const ConnectionLimits& limits)
    : fd_(std::move(fd)),
      framing_(framing),
      max_request_bytes_(limits.max_request_bytes),
      lines_(limits.max_request_bytes),
      queue_(limits.queue_bytes) {}

void Connection::receive(std::span<char> scratch) {
  if (packet_request_ != Request::kNone) return;  // the one before waits for room for its answer
  bool cut_off = false;
  const ssize_t n = read_some(scratch, cut_off);
  if (n > 0) {
    const std::span<const char> bytes = scratch.first(static_cast<std::size_t>(n));
    if (framing_ == Framing::kPackets) return take_packet(bytes, cut_off);
    lines_.append({bytes.data(), bytes.size()});
  } else if (n == 0) {  // for packets also an empty one: the kernel does not tell them apart
    input_closed_ = true;
  } else if (errno != EAGAIN && errno != EINTR) {
    gone_ = true;
  }
}

ssize_t Connection::read_some(std::span<char> into, bool& cut_off) {
  iovec part{into.data(), into.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  const ssize_t n = recvmsg(fd_.get(), &message, MSG_DONTWAIT);
  cut_off = (message.msg_flags & MSG_TRUNC) != 0;
  return n;
}

void Connection::take_packet(std::span<const char> bytes, bool cut_off) {
  while (!cut_off && !bytes.empty() && bytes.back() == '\n') bytes = bytes.first(bytes.size() - 1);
  const bool too_long = cut_off || bytes.size() > max_request_bytes_;
  packet_request_ = too_long ? Request::kTooLong : Request::kText;
  packet_.assign(bytes.data(), too_long ? 0 : bytes.size());
}

Connection::Request Connection::next_request(std::string& text) {
  if (framing_ == Framing::kPackets) {
    text = std::move(packet_);
    packet_.clear();
    return std::exchange(packet_request_, Request::kNone);
  }
  switch (lines_.next(text)) {
    case LineBuffer::Next::kLine:
      return Request::kText;
    case LineBuffer::Next::kTooLong:
      return Request::kTooLong;
    case LineBuffer::Next::kNone:
      break;
  }
  // A line that has brought this much without an end is a flood, not a mistake.
  constexpr std::size_t kMaxDiscardedBytes = 16 * 1024 * 1024;
  if (lines_.discarded_bytes() > kMaxDiscardedBytes) gone_ = true;
  return Request::kNone;
}

bool Connection::drop_partial_request() {
  const bool had_one = has_partial_request();
  lines_ = LineBuffer(max_request_bytes_);
  return had_one;
}

void Connection::push(RecordText text, std::optional<std::uint64_t> seq) {
  if (queue_.empty()) last_progress_ = Clock::now();
  queue_.push(std::move(text), seq);
}

bool Connection::offer(const RecordText& text, std::uint64_t seq) {
  if (queue_.empty()) last_progress_ = Clock::now();
  return queue_.offer(text, seq);
}

void Connection::flush(LossTeller& losses) {
  while (!gone_ && !queue_.empty()) {
    const ssize_t sent = framing_ == Framing::kLines ? send_lines() : send_packet();
    if (sent < 0) {
      if (errno == EINTR || (errno != EAGAIN && replace_unsendable(losses))) continue;
      gone_ = errno != EAGAIN;
      return;
    }
    last_progress_ = Clock::now();
    const std::optional<Gap> gap = queue_.consume(static_cast<std::size_t>(sent));
    if (gap) queue_.push(losses.gap_line(*gap));
  }
}

ssize_t Connection::send_lines() {
  std::array<iovec, kSendParts> parts;
  msghdr message{};
  message.msg_iov = parts.data();
  message.msg_iovlen = queue_.gather(parts);
  return sendmsg(fd_.get(), &message, MSG_NOSIGNAL | MSG_DONTWAIT);
}

/// Sends one text without its newline; returns what that consumes of the queue.
ssize_t Connection::send_packet() {
  const std::string& text = *queue_.front();
  const std::size_t bytes = text.size() - 1;
  ssize_t sent = send(fd_.get(), text.data(), bytes, MSG_NOSIGNAL | MSG_DONTWAIT);
  if (sent < 0 && errno == EMSGSIZE && enlarge_send_buffer(bytes)) {
    sent = send(fd_.get(), text.data(), bytes, MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  return sent < 0 ? sent : sent + 1;
}

/// A packet must fit into the send buffer as a whole. The kernel grants up to twice
/// net.core.wmem_max. Leaves errno as it is if that is not enough.
bool Connection::enlarge_send_buffer(std::size_t packet_bytes) {
  const std::size_t needed = packet_bytes + kPacketOverheadBytes;
  if (needed > static_cast<std::size_t>(std::numeric_limits<int>::max())) return false;
  const int error = errno;
  const int asked = static_cast<int>(needed);
  setsockopt(fd_.get(), SOL_SOCKET, SO_SNDBUF, &asked, sizeof(asked));
  const bool enough = send_buffer_bytes(fd_.get()) >= needed;
  errno = error;
  return enough;
}

/// Whether the first text was a record that no packet can hold and has given its place to a short
/// one that says so. Leaves errno as it is if not.
bool Connection::replace_unsendable(LossTeller& losses) {
  const bool too_large = errno == EMSGSIZE || errno == ENOBUFS || errno == ENOMEM;
  if (framing_ != Framing::kPackets || !too_large || !queue_.front_seq()) return false;
  queue_.replace_front(losses.too_large_line(*queue_.front_seq()));
  return true;
}

}  // namespace loopd
