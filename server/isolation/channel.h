// Messages between the server and the process of a job, over a socket.
#pragma once

#include <google/protobuf/message_lite.h>

#include <functional>
#include <mutex>
#include <string>
#include <string_view>

namespace varimesh::server {

/// The largest message, in bytes. A larger one ends the channel.
inline constexpr std::size_t kMostFrameBytes = std::size_t{32} << 20;

/// Sends and receives messages, each after its length in four bytes. A message may bring an open file along.
class Channel {
 public:
  /// What receive() has found.
  enum class Got {
    Message,
    Nothing,  ///< Within the time.
    End,      ///< The other side is gone.
    Breach    ///< What came is no message.
  };

  /// Takes ownership of a stream socket.
  explicit Channel(int socket) : socket_(socket) {}
  ~Channel();
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;

  /// Sends a message, and a copy of the descriptor `file` with it unless that is −1. Returns false if the other side is
  /// gone or takes nothing. Thread-safe.
  bool send(const google::protobuf::MessageLite& message, int file = -1);
  /// Whether the other side has closed its end. What it sent before can still be received.
  bool is_closed() const;
  /// Receives the next message. One thread at a time.
  /// @param milliseconds how long it waits; negative: until something comes
  /// @param accept looks at the bytes before they become a message; false: Breach. Empty: all are accepted.
  Got receive(google::protobuf::MessageLite& message, int milliseconds,
              const std::function<bool(std::string_view)>& accept = {});
  /// Returns the descriptor that came last and was not taken yet, which the caller closes; −1: none.
  int take_file();
  /// From now on send() returns false when the other side takes nothing for this long.
  void limit_sending(int seconds);

 private:
  Got fill(int milliseconds);

  const int socket_;
  std::mutex sending_;
  std::string received_;
  std::size_t begin_ = 0;  ///< Of what was not parsed yet.
  int file_ = -1;
};

}  // namespace varimesh::server
