// The admin port: health for probes, and a page that watches. Plain HTTP, for this machine alone; nothing can be
// changed through it.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>

#include "core/base/error.h"
#include "server/operations/watching.h"

struct mg_connection;
struct mg_context;

namespace varimesh::server {

/// An HTTP server with threads of its own, so that whoever watches never holds up a call.
///
///   GET /                       the page; its script and style beside it
///   GET /healthz/live           200 as long as the process answers
///   GET /healthz/ready          200 where jobs are taken, 503 where not
///   GET /api/status             Watching::status()
///   GET /api/iterations?job=NAME&after=N    Watching::iterations()
///
/// Other methods are answered with 405, and requests whose Host is not a name of this machine's loopback with 421: a
/// page from elsewhere whose name was made to point here (DNS rebinding) gets nothing.
class AdminServer {
 public:
  /// Listens on HOST:PORT, where HOST is 127.0.0.0/8, [::1] or localhost, and port 0 takes a free one. Errors:
  /// BadOption for any other address, Output where it is taken.
  static Expected<std::unique_ptr<AdminServer>> start(const std::string& address, Watching* watching,
                                                      std::function<bool()> ready);
  ~AdminServer();
  AdminServer(const AdminServer&) = delete;
  AdminServer& operator=(const AdminServer&) = delete;

  /// Where it listens, with the port that was chosen.
  const std::string& address() const { return address_; }

 private:
  AdminServer(Watching* watching, std::function<bool()> ready) : watching_(watching), ready_(std::move(ready)) {}
  static int handle(mg_connection* connection);
  void answer(mg_connection* connection) const;

  Watching* const watching_;
  const std::function<bool()> ready_;
  std::string address_;
  mg_context* context_ = nullptr;
};

/// Whether a request's Host header names this machine's loopback, with or without a port. Null: there was none.
bool is_own_host(const char* host);

}  // namespace varimesh::server
