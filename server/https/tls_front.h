// TLS in front of the HTTP server of this process.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>

#include "core/base/error.h"
#include "server/https/tls_connection.h"
#include "server/sockets/tcp_listener.h"
#include "server/streams/peer_counts.h"

namespace varimesh::server {

/// Accepts encrypted connections and passes what they say on to a port of 127.0.0.1, at which civetweb listens.
/// civetweb 1.15 encrypts only with OpenSSL up to 1.1. One thread does all of it, and nobody waits for a slow client.
///
/// A connection to that port comes from an address of its own in 127.0.0.0/8, by which the caller is found again. Other
/// programs of this machine can reach the port, too, but their connections have no caller. The process must ignore
/// SIGPIPE, since OpenSSL writes to connections that clients have closed.
class TlsFront {
 public:
  struct Caller {
    std::string address;      ///< Without the port.
    std::string certificate;  ///< The common name in the client's certificate; empty if it needs none.
  };

  /// Listens on HOST:PORT. `files` must be good whenever they are read (last_good_files.h): every two seconds, so new
  /// connections see new certificates. Errors: BadOption if one cannot be used; Output if the address is taken.
  static Expected<std::unique_ptr<TlsFront>> start(const std::string& address, const TlsFiles& files, int port_behind);
  /// Calls stop().
  ~TlsFront();
  TlsFront(const TlsFront&) = delete;
  TlsFront& operator=(const TlsFront&) = delete;

  /// Ends all connections and accepts no more. Callers are still found, but there are none.
  void stop();
  /// The address with the port that was chosen.
  const std::string& address() const { return address_; }
  /// Who is behind a connection to the plain port that comes from this address. Nothing: no client of this object.
  std::optional<Caller> caller(const std::string& address, int port) const;
  /// Whether the server's certificate is for the host of a Host header, which may have a port.
  bool is_named(const std::string& host) const;

 private:
  struct Client {
    std::unique_ptr<TlsConnection> connection;
    std::shared_ptr<const void> place, place_of_peer;
    std::string key;  ///< In callers_; empty until the plain connection is made.
  };

  TlsFront(TlsFiles files, int port_behind);
  void run();
  /// Says in the log that the thread cannot go on, ends all connections and accepts no more.
  void fail(const char* reason);
  /// Takes a connection that was accepted, if there are places. `peer`: who its place is counted for.
  void take(int socket, const std::string& peer);
  /// Whether there are descriptors for one more plain connection.
  bool has_room_inside() const;
  /// Makes the plain connection of a client. Returns its socket; negative: that failed.
  int open(std::uint64_t id, const std::string& address, const std::string& certificate);
  void step(std::uint64_t id);
  void end(std::uint64_t id);
  void end_late_ones();
  /// Uses the files if they have changed and are good.
  void read_files();
  TlsContext context() const;

  const TlsFiles files_;
  const int port_behind_;
  std::string address_;
  PeerCounts places_, places_of_peer_;
  mutable std::mutex mutex_;  ///< Locked for context_, bytes_, callers_ and clients_.
  TlsContext context_;
  std::string bytes_;  ///< Of the files that were read last.
  std::map<std::string, Caller> callers_;
  std::map<std::uint64_t, Client> clients_;  ///< Only the thread ends them.
  std::uint64_t next_id_ = 1;
  std::uint32_t next_source_ = 0;  ///< Only the thread uses it.
  std::set<std::uint64_t> busy_;   ///< Those that have more to do. Only the thread uses it.
  int events_ = -1, wake_ = -1;
  std::atomic<bool> stopping_ = false;
  std::unique_ptr<TcpListener> listener_;
  std::thread thread_;
};

}  // namespace varimesh::server
