// One encrypted connection of a client, and the plain one behind it.
#pragma once

#include <openssl/ssl.h>

#include <chrono>
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "server/https/tls_context.h"

namespace varimesh::server {

/// Passes bytes from one connection to the other, in both directions, as fast as the slower side takes them: it keeps
/// at most kRoom bytes of each direction. It never waits. Both sockets must not block, and one thread at a time uses an
/// object.
class TlsConnection {
 public:
  using Clock = std::chrono::steady_clock;
  /// How long a client may take to shake hands and to send the first bytes, to take some of the answer, and to close
  /// the connection after the whole answer.
  static constexpr std::chrono::seconds kGreeting{10}, kStalled{30}, kGoodbye{2};
  static constexpr std::size_t kRoom = std::size_t{64} << 10;
  /// How many bytes of a client are read to no end after the whole answer.
  static constexpr std::size_t kMostUnwanted = std::size_t{4} << 20;

  /// Makes the plain connection when a client whose certificate has this name has sent its first bytes. Returns its
  /// socket; negative: that failed.
  using Open = std::function<int(const std::string& name)>;

  /// Takes the socket of a client, which it closes.
  TlsConnection(int socket, const TlsContext& context, Open open);
  ~TlsConnection();
  TlsConnection(const TlsConnection&) = delete;
  TlsConnection& operator=(const TlsConnection&) = delete;

  /// What happens after a step: it goes on when a socket has changed, or there was more to do than others should wait
  /// for, or the connection has ended.
  enum class Next { Wait, Again, End };
  /// Does what can be done now.
  Next step();
  /// Whether the client has taken too long for something.
  bool is_late(Clock::time_point now) const;

 private:
  /// Bytes on their way in one direction.
  class Bytes {
   public:
    bool empty() const { return first_ == last_; }
    std::string_view waiting() const { return {bytes_.data() + first_, last_ - first_}; }
    void take(std::size_t count);
    /// Where more bytes may be written, and how many.
    char* room(std::size_t* count);
    void add(std::size_t count) { last_ += count; }

   private:
    std::vector<char> bytes_;  ///< Empty until it is needed.
    std::size_t first_ = 0, last_ = 0;
  };

  /// Each returns whether a byte has moved.
  bool read_client();
  bool write_plain();
  bool read_plain();
  bool write_client();
  /// Whether OpenSSL waits for the client after a call that returned this. Otherwise the connection is at its end.
  bool is_waiting(int result);
  /// Tells the client that no more bytes come. Returns whether that was sent, or cannot be.
  bool send_end();
  Next say_goodbye();

  const int socket_;
  const std::unique_ptr<SSL, decltype(&SSL_free)> ssl_;
  const Open open_;
  int plain_ = -1;
  Bytes there_, back_;
  bool client_sends_no_more_ = false, plain_takes_no_more_ = false, plain_sends_no_more_ = false;
  bool is_broken_ = false;     ///< The client is gone.
  bool is_ending_ = false;     ///< The client still has to take that no more bytes come.
  bool has_answered_ = false;  ///< The whole answer was sent; only the client's end of the connection is awaited.
  std::size_t unwanted_ = 0;   ///< Bytes that have come since then.
  const Clock::time_point begun_ = Clock::now();
  Clock::time_point moved_ = begun_;  ///< When the client took bytes of the answer, or none waited.
};

}  // namespace varimesh::server
