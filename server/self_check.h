// Whether the server answers calls, as its clients see it.
#pragma once

#include <atomic>
#include <chrono>
#include <string>

namespace varimesh::server {

/// Dials the server's own address. A server that cannot accept connections, because all its descriptors are taken for
/// example, runs and considers itself well, but nobody reaches it.
class SelfCheck {
 public:
  /// `address`: what the server listens on; empty: it does not listen, and answers() is true. `tls`: the server
  /// encrypts.
  explicit SelfCheck(std::string address, bool tls = false,
                     std::chrono::milliseconds patience = std::chrono::milliseconds(3000));

  /// Asks for the health of the server over a new connection or, if the server encrypts, for the beginning of TLS:
  /// there may be no certificate with which it would let itself in. Returns when the answer is there, and at the latest
  /// after the patience.
  void dial();
  /// Whether the server has answered the last time; false before the first dial().
  bool answers() const { return answers_; }

 private:
  const std::string address_;
  const bool tls_;
  const std::chrono::milliseconds patience_;
  std::atomic<bool> answers_;
};

/// Returns the address at which a server on this machine that listens on `address` is reached: a loopback address
/// instead of 0.0.0.0 and [::].
std::string own_address(const std::string& address);

}  // namespace varimesh::server
