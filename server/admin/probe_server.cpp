// Answers probes and Prometheus.
#include "server/admin/probe_server.h"

#include <civetweb.h>

namespace varimesh::server {
namespace {

constexpr std::chrono::seconds kFresh{1};

}  // namespace

Expected<std::unique_ptr<ProbeServer>> ProbeServer::start(const std::string& address, std::function<bool()> ready,
                                                          std::function<std::string()> metrics) {
  std::unique_ptr<ProbeServer> server(new ProbeServer(std::move(ready), std::move(metrics)));
  if (const auto listening = server->http_.listen(address, "--metrics", handle, server.get()); !listening)
    return tl::unexpected(listening.error());
  return server;
}

int ProbeServer::handle(mg_connection* connection) {
  auto* const server = static_cast<ProbeServer*>(mg_get_request_info(connection)->user_data);
  try {
    server->answer(connection);
  } catch (const std::exception&) {  // out of memory, if anything
    send_http(connection, 503, kTextType, "The server cannot answer now; try again.\n");
  }
  return 1;  // every request has been answered
}

void ProbeServer::answer(mg_connection* connection) {
  const mg_request_info& request = *mg_get_request_info(connection);
  const std::string_view method = request.request_method, path = request.local_uri;
  if (method != "GET" && method != "HEAD")
    return send_http(connection, 405, kTextType, "This port is read-only.\n", "Allow: GET, HEAD\r\n");
  if (path == "/healthz/live") return send_http(connection, 200, kTextType, "live\n");
  if (path == "/healthz/ready") {
    const bool ready = ready_();
    return send_http(connection, ready ? 200 : 503, kTextType, ready ? "ready\n" : "not ready\n");
  }
  if (path == "/metrics") {
    const std::string text = measured();
    if (text.empty())
      return send_http(connection, 404, kTextType,
                       "This varimeshd was built without prometheus-cpp and has no metrics.\n");
    return send_http(connection, 200, "text/plain; version=0.0.4; charset=utf-8", text);
  }
  send_http(connection, 404, kTextType, "There is nothing at this address.\n");
}

std::string ProbeServer::measured() {
  std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (text_.empty() || now - time_ >= kFresh) {
    text_ = metrics_();
    time_ = now;
  }
  return text_;
}

}  // namespace varimesh::server
