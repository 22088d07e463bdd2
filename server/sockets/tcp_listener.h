// Accepts the connections of a TCP address and hands them on, as long as there are descriptors for them.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "core/base/error.h"

namespace varimesh::server {

/// Which connections may stay. gRPC 1.51 stops accepting for ever once accept() had no descriptor (CVE-2023-4785), so
/// connections must not take the last ones. Not thread-safe.
class Admission {
 public:
  /// Decides about a connection that was accepted.
  ///
  /// @param descriptor its descriptor. Systems give the lowest free number, so it says how many are taken.
  /// @param address    the peer's, without its port
  /// @param limit      how many descriptors the process may have (RLIMIT_NOFILE)
  bool admits(int descriptor, const std::string& address, long limit);

  /// How many of `limit` descriptors are left to everything that is no connection.
  static long reserve(long limit) { return std::max(32L, std::min(limit / 4, 4096L)); }
  /// How many connections to itself the process may have besides, for those that are encrypted. Each takes two
  /// descriptors, which come out of the reserve if there are no others, and a quarter of the reserve stays free.
  static long most_inside(long limit) { return reserve(limit) * 3 / 8; }
  /// How many descriptors this process may have now.
  static long descriptor_limit();
  /// How many connections one address may have.
  static long most_of_an_address(long limit) { return (limit - reserve(limit)) / 2; }

 private:
  struct Held {
    std::string address;
    std::uint64_t socket;  ///< Its inode: who has the descriptor later has another one.
  };
  /// Forgets connections of an address that were closed, but only now and then, since it looks at each of them.
  void forget_closed(const std::string& address);
  void forget(int descriptor);

  std::unordered_map<int, Held> held_;  ///< By descriptor.
  std::map<std::string, long> count_;   ///< By address.
  /// When the connections of an address that has its most were last looked at.
  std::map<std::string, std::chrono::steady_clock::time_point> looked_;
};

/// A listening TCP address with a thread that accepts.
class TcpListener {
 public:
  /// Takes a connection, and closes it when it has ended. `listening`: the socket at which it came. `peer`: the address
  /// of the client without its port; of IPv6 the network.
  using Taker = std::function<void(int listening, int socket, const std::string& peer)>;

  /// Listens on HOST:PORT, but accepts nobody before start(). A wildcard address listens to IPv4 and IPv6. A name
  /// listens at each of its addresses that this machine has. Error: Output if one is taken, or none is of this machine.
  static Expected<std::unique_ptr<TcpListener>> open(const std::string& address);
  ~TcpListener();
  TcpListener(const TcpListener&) = delete;
  TcpListener& operator=(const TcpListener&) = delete;

  /// The port, which the system chose if it was 0.
  int port() const { return port_; }
  /// Begins to hand connections on, from a thread of its own.
  void start(Taker taker);
  /// Accepts nobody any more. Connections that were handed on stay.
  void stop();
  /// Whether the machine's own connection, as the server's to itself, was refused in the last `window` because there
  /// are too many.
  bool turned_away(std::chrono::milliseconds window) const;

 private:
  TcpListener() = default;
  void run();
  /// Accepts one connection. False if there is none, or no descriptor for it.
  bool accept_from(int listening);

  std::vector<int> listening_;
  int port_ = 0;
  int wake_ = -1;  ///< An eventfd, which is readable once the thread is to end.
  Admission admission_;
  Taker taker_;
  std::atomic<std::chrono::steady_clock::rep> turned_away_{0};  ///< When; 0: never.
  std::chrono::steady_clock::time_point warned_{};              ///< When the log was told of a refused connection.
  std::thread thread_;
};

}  // namespace varimesh::server
