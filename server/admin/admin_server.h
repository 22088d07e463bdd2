// The admin port: health checks, and the live page that shows the jobs and cancels them. It uses plain HTTP and accepts
// requests only from this machine.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "server/admin/live_status.h"
#include "server/http/listen.h"

namespace varimesh::server {

/// An HTTP server with threads of its own, so that an open page never delays a call.
///
///   GET /                       the live page; its script and style are beside it
///   GET /healthz/live           200 as long as the process answers
///   GET /healthz/ready          200 if the server accepts jobs, otherwise 503
///   GET /api/status             LiveStatus::status()
///   GET /api/iterations?job=NAME&after=N    LiveStatus::iterations()
///   POST /api/cancel?job=NAME   cancels a job; 204
///
/// What is below /api needs "Authorization: Bearer TOKEN" if the server asks who calls: without a token the answer is
/// 401, without the right to read 403, and other owners' jobs are not there.
///
/// A cancel needs a token with that right, also on a server that lets everybody in, and the header Origin of this very
/// port: a page of another site, or of another port of this machine, has another Origin, and cannot send a token.
///
/// Other methods get 405. Requests whose Host is not a loopback name get 421, so that a foreign page whose host name
/// was made to point here (DNS rebinding) cannot read anything.
class AdminServer {
 public:
  /// Lets a caller in for LivePage or LivePageCancel, with the header "authorization".
  using Admit = std::function<Answer<CallersView>(Method, std::string_view authorization)>;

  /// Listens on HOST:PORT. HOST is in 127.0.0.0/8, [::1] or localhost, and port 0 is any free port. `ready`: whether
  /// the server accepts jobs. Errors: BadOption for any other address, Output if the address is taken.
  static Expected<std::unique_ptr<AdminServer>> start(const std::string& address,
                                                      std::unique_ptr<LiveStatus> live_status,
                                                      std::function<bool()> ready, Admit admit);

  /// The address with the port that was chosen.
  const std::string& address() const { return http_.address(); }

 private:
  AdminServer(std::unique_ptr<LiveStatus> live_status, std::function<bool()> ready, Admit admit)
      : live_status_(std::move(live_status)), ready_(std::move(ready)), admit_(std::move(admit)) {}
  static int handle(mg_connection* connection);
  void answer(mg_connection* connection) const;
  /// Answers a request below /api.
  void answer_about_jobs(mg_connection* connection) const;
  /// Answers a request to cancel a job.
  void cancel(mg_connection* connection) const;

  const std::unique_ptr<LiveStatus> live_status_;
  const std::function<bool()> ready_;
  const Admit admit_;
  HttpServer http_;  ///< The last member, so that its threads end first.
};

}  // namespace varimesh::server
