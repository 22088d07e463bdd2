// OpenSSL on sockets that do not block. One thread serves many connections, and OpenSSL keeps errors by thread, so what
// another connection has left is cleared before each call (SSL_get_error(3)).
#include "server/https/tls_connection.h"

#include <openssl/err.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

namespace varimesh::server {
namespace {

/// How often bytes are moved before other connections have their turn.
constexpr int kMostMoves = 8;

bool would_block() { return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR; }

}  // namespace

void TlsConnection::Bytes::take(std::size_t count) {
  first_ += count;
  if (first_ == last_) first_ = last_ = 0;
}

char* TlsConnection::Bytes::room(std::size_t* count) {
  bytes_.resize(kRoom);
  *count = kRoom - last_;
  return bytes_.data() + last_;
}

TlsConnection::TlsConnection(int socket, const TlsContext& context, Open open)
    : socket_(socket), ssl_(SSL_new(context.get()), SSL_free), open_(std::move(open)) {
  is_broken_ = ssl_ == nullptr || SSL_set_fd(ssl_.get(), socket) != 1;
  if (!is_broken_) SSL_set_accept_state(ssl_.get());
}

TlsConnection::~TlsConnection() {
  ::close(socket_);
  if (plain_ >= 0) ::close(plain_);
}

bool TlsConnection::is_waiting(int result) {
  const int reason = SSL_get_error(ssl_.get(), result);
  ERR_clear_error();
  return reason == SSL_ERROR_WANT_READ || reason == SSL_ERROR_WANT_WRITE;
}

TlsConnection::Next TlsConnection::step() {
  if (is_broken_) return Next::End;
  if (has_answered_) return say_goodbye();
  if (SSL_is_init_finished(ssl_.get()) == 0) {
    ERR_clear_error();
    if (const int done = SSL_do_handshake(ssl_.get()); done != 1) return is_waiting(done) ? Next::Wait : Next::End;
  }
  for (int move = 0; move < kMostMoves; ++move) {
    // Every call must be made, and none may be left before it can do no more: sockets tell of changes only.
    bool moved = read_client();
    moved = write_plain() || moved;
    moved = read_plain() || moved;
    moved = write_client() || moved;
    if (is_broken_) return Next::End;
    if (plain_sends_no_more_ && back_.empty()) {
      if (!send_end()) return Next::Wait;
      ::shutdown(socket_, SHUT_WR);
      has_answered_ = true;
      moved_ = Clock::now();
      return say_goodbye();
    }
    if (!moved) return Next::Wait;
  }
  return Next::Again;
}

bool TlsConnection::send_end() {
  ERR_clear_error();
  const int result = SSL_shutdown(ssl_.get());
  is_ending_ = result < 0 && SSL_get_error(ssl_.get(), result) == SSL_ERROR_WANT_WRITE;
  ERR_clear_error();
  return !is_ending_;
}

bool TlsConnection::read_client() {
  if (client_sends_no_more_ || plain_takes_no_more_ || !there_.empty()) return false;
  bool moved = false;
  for (;;) {
    std::size_t count = 0;
    char* const room = there_.room(&count);
    if (count == 0) break;
    ERR_clear_error();
    const int got = SSL_read(ssl_.get(), room, static_cast<int>(count));
    if (got > 0) {
      there_.add(static_cast<std::size_t>(got));
      moved = true;
      continue;
    }
    client_sends_no_more_ = SSL_get_error(ssl_.get(), got) == SSL_ERROR_ZERO_RETURN;
    is_broken_ = !client_sends_no_more_ && !is_waiting(got);
    break;
  }
  if (plain_ < 0 && !there_.empty() && !is_broken_) {
    plain_ = open_(name_of_client(*ssl_));
    is_broken_ = plain_ < 0;
  }
  if (plain_ < 0 && client_sends_no_more_) is_broken_ = true;  // it wanted nothing
  return moved;
}

bool TlsConnection::write_plain() {
  if (plain_ < 0) return false;
  bool moved = false;
  while (!there_.empty() && !plain_takes_no_more_) {
    const std::string_view bytes = there_.waiting();
    const auto sent = ::send(plain_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && would_block()) return moved;
    // The server has given up the request. What it has said about it can still be read.
    if (sent < 0) plain_takes_no_more_ = true;
    there_.take(sent < 0 ? bytes.size() : static_cast<std::size_t>(sent));
    moved = true;
  }
  if (client_sends_no_more_ && !std::exchange(plain_takes_no_more_, true)) ::shutdown(plain_, SHUT_WR);
  return moved;
}

bool TlsConnection::read_plain() {
  if (plain_ < 0 || plain_sends_no_more_ || !back_.empty()) return false;
  std::size_t count = 0;
  char* const room = back_.room(&count);
  const auto got = ::recv(plain_, room, count, 0);
  const bool is_connecting = got < 0 && errno == ENOTCONN && !plain_takes_no_more_;
  if (is_connecting || (got < 0 && would_block())) return false;
  if (got <= 0) plain_sends_no_more_ = true;
  moved_ = Clock::now();
  back_.add(got <= 0 ? 0 : static_cast<std::size_t>(got));
  return true;
}

bool TlsConnection::write_client() {
  bool moved = false;
  while (!back_.empty()) {
    const std::string_view bytes = back_.waiting();
    ERR_clear_error();
    const int sent = SSL_write(ssl_.get(), bytes.data(), static_cast<int>(bytes.size()));
    if (sent <= 0) {
      is_broken_ = !is_waiting(sent);
      return moved;
    }
    back_.take(static_cast<std::size_t>(sent));
    moved_ = Clock::now();
    moved = true;
  }
  return moved;
}

TlsConnection::Next TlsConnection::say_goodbye() {
  // If it were closed before all that the client sends was read, the client might lose the answer.
  std::array<char, 16384> scratch;
  for (int move = 0; move < kMostMoves; ++move) {
    const auto got = ::recv(socket_, scratch.data(), scratch.size(), 0);
    if (got < 0 && would_block()) return Next::Wait;
    if (got <= 0 || (unwanted_ += static_cast<std::size_t>(got)) > kMostUnwanted) return Next::End;
  }
  return Next::Again;
}

bool TlsConnection::is_late(Clock::time_point now) const {
  if (has_answered_) return now - moved_ > kGoodbye;
  if (plain_ < 0) return now - begun_ > kGreeting;
  return (is_ending_ || !back_.empty()) && now - moved_ > kStalled;
}

}  // namespace varimesh::server
