#pragma once

#include <fcntl.h>
#include <sys/mman.h>

#include <cstring>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "events/control_server.h"
#include "events/server_fixture.h"

namespace loopd::testing {

/// An empty file in memory, open for reading and writing.
inline UniqueFd memory_file() {
  UniqueFd fd(memfd_create("recording", MFD_CLOEXEC));
  EXPECT_TRUE(fd.valid());
  return fd;
}

/// Sends `bytes` with `fds` passed along, as one message.
inline bool send_with(int socket, std::string_view bytes, const std::vector<int>& fds) {
  std::vector<char> control(CMSG_SPACE(fds.size() * sizeof(int)));
  iovec part{const_cast<char*>(bytes.data()), bytes.size()};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(fds.size() * sizeof(int));
  std::memcpy(CMSG_DATA(header), fds.data(), fds.size() * sizeof(int));
  return sendmsg(socket, &message, MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
}

/// A control server on a socket of its own whose daemon notes what it is asked.
class ControlTest : public ::testing::Test {
 protected:
  ControlTest() { options_.socket_path = (dir_ / "control.sock").string(); }

  void start(InheritedSockets* inherited = nullptr) {
    ControlActions actions{[this](ControlRequest request) { return handle(std::move(request)); },
                           [this](std::uint64_t client) { gone_.push_back(client); }};
    auto server = ControlServer::listen(loop_.get(), options_, std::move(actions), inherited);
    ASSERT_TRUE(server.ok()) << server.error().message;
    server_ = std::move(server).value();
  }

  ControlReply handle(ControlRequest request) {
    requests_.push_back(std::move(request));
    return reply_;
  }

  std::unique_ptr<TestClient> connect() {
    return std::make_unique<TestClient>(loop_, options_.socket_path);
  }
  /// Sends one line and returns the answer to it.
  json ask(TestClient& client, const std::string& line) {
    const std::size_t before = client.records().size();
    EXPECT_TRUE(client.send(line + "\n"));
    return answer_after(client, before);
  }
  json ask_with(TestClient& client, const std::string& line, const std::vector<int>& fds) {
    const std::size_t before = client.records().size();
    EXPECT_TRUE(send_with(client.fd(), line + "\n", fds));
    return answer_after(client, before);
  }
  json answer_after(TestClient& client, std::size_t before) {
    EXPECT_TRUE(
        loop_.run_until([&] { return client.records().size() > before || client.ended(); }));
    return client.records().size() > before ? client.records()[before] : json();
  }

  TempDir dir_;
  Loop loop_;
  ControlOptions options_;
  std::vector<ControlRequest> requests_;
  std::vector<std::uint64_t> gone_;
  ControlReply reply_;
  std::unique_ptr<ControlServer> server_;
};

}  // namespace loopd::testing
