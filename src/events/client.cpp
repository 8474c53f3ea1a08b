#include "events/client.h"

#include <cerrno>

namespace loopd {

Result<EventClient> EventClient::connect(const std::string& socket_path,
                                         std::size_t max_record_bytes) {
  Result<ClientConnection> connection = ClientConnection::connect(socket_path, max_record_bytes);
  if (!connection) return connection.error();
  return EventClient(std::move(connection).value());
}

Status EventClient::watch(const WatchRequest& request) {
  Status sent = send(request_text(request) + "\n");
  if (!sent && sent.error().code == EPIPE) return Nothing();
  return sent;
}

}  // namespace loopd
