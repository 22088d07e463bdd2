// The services of the contract over HTTP, with JSON, for those without gRPC.
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "server/access/rights.h"
#include "server/failure.h"
#include "server/http/exchange.h"
#include "server/http/listen.h"
#include "server/http/open_sockets.h"
#include "server/http/routes.h"
#include "server/https/tls_front.h"
#include "server/resources/pool.h"
#include "server/streams/peer_counts.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Where the gateway listens.
struct HttpPorts {
  std::string plain;      ///< HOST:PORT; empty: nowhere without TLS.
  std::string encrypted;  ///< HOST:PORT; empty: nowhere with TLS.
  TlsFiles tls;           ///< For `encrypted`: as TlsFront::start() takes them.
  bool insecure = false;  ///< `plain` may be beyond loopback, for a proxy in a trusted network.
};

/// An HTTP server whose requests become calls of this server's own services, so callers, owners, limits, the log and
/// traces are the same. Bodies are proto3 JSON of the contract's messages; errors are google.rpc.Status.
/// routes.h has the addresses.
///
/// A token comes as "Authorization: Bearer TOKEN"; there are no cookies. A page of another site is refused by its
/// Origin. A page whose host name was made to point here (DNS rebinding) is refused by its Host, which must be a name
/// of this machine or, with TLS, a name in the server's certificate.
class Gateway {
 public:
  /// The peer that the limits count, if the caller may call the method. Asked before a body is read.
  using Admit = std::function<Answer<std::string>(Method, std::string_view authorization, const HttpCaller& caller)>;

  /// Listens at one of the ports or at both, which share all limits. The HOST of the plain one is in 127.0.0.0/8, [::1]
  /// or localhost unless it is `insecure`, and port 0 is any free port. `channel`: leads to the services in this
  /// process. Errors: BadOption for any other plain address, Output if an address is taken.
  static Expected<std::unique_ptr<Gateway>> start(const HttpPorts& ports, std::shared_ptr<grpc::Channel> channel,
                                                  Admit admit);

  ~Gateway();

  /// The addresses with the ports that were chosen; empty if there is none.
  const std::string& address() const { return http_.address(); }
  std::string encrypted_address() const { return front_ == nullptr ? "" : front_->address(); }

  /// Cuts uploads, downloads and watches, now and later, because the server stops: their clients come again.
  void end_long_requests() { open_.shut_down(); }

 private:
  Gateway(const std::shared_ptr<grpc::Channel>& channel, Admit admit);
  static int handle(mg_connection* connection);
  /// Who has sent the request. Nothing if it came to the port behind TLS, but not through TLS.
  std::optional<HttpCaller> caller_of(const mg_request_info& request) const;
  bool is_own_name(const HttpExchange& exchange) const;
  void answer(HttpExchange& exchange) const;
  /// Answers a request that goes to this route; `id` is what stands for {…} in its path.
  void answer(HttpExchange& exchange, const Route& route, const std::string& id) const;
  /// Requests that keep a thread for long, of all callers and of each.
  struct Places {
    PeerCounts all, of_peer;
    const char* what;
  };
  /// Does work that keeps a thread for long, if the caller may call the method and there is a place.
  void work_long(HttpExchange& exchange, Method method, Places& places, const std::function<void()>& work) const;
  /// Does work that keeps a thread for long, if there is a place for this peer.
  void in_place(HttpExchange& exchange, const std::string& peer, Places& places,
                const std::function<void()>& work) const;
  void list(HttpExchange& exchange) const;
  void submit(HttpExchange& exchange) const;

  const std::unique_ptr<v1::JobService::Stub> jobs_;
  const std::unique_ptr<v1::MeshService::Stub> meshes_;
  const std::unique_ptr<v1::OptimiseService::Stub> optimise_;
  const Admit admit_;
  mutable Places transfers_, submissions_, watches_, page_files_;
  mutable OpenSockets open_;  ///< Of the requests that have such a place.
  mutable Pool large_texts_{1};
  std::atomic<bool> is_open_ = false;  ///< All of this object can be used by the threads of `http_`.
  std::unique_ptr<TlsFront> front_;    ///< Null: nothing is encrypted. Its connections lead to `http_`.
  HttpServer http_;                    ///< The last member, so that its threads end first.
};

}  // namespace varimesh::server
