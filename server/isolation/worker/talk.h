// What the process of a job says to the server, and hears from it.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "server/isolation/channel.h"
#include "server/isolation/worker.pb.h"

namespace varimesh::server {

/// Pieces of an output that go out together, in bytes.
inline constexpr std::size_t kPieceBytes = std::size_t{512} << 10;
/// This process's side of the conversation. Its thread takes what the server says.
class Conversation {
 public:
  explicit Conversation(Channel& channel) : channel_(channel) {}

  /// Starts the thread, which lives as long as the process.
  void listen() {
    std::thread([this] { take_all(); }).detach();
  }
  void say(const worker::FromWorker& message) {
    if (!channel_.send(message)) ::_exit(1);  // the server is gone
  }
  /// Asks and waits for the answer. `answered` gets the descriptor that comes back, or −1.
  worker::Answer ask(const worker::FromWorker& question, int* answered = nullptr) {
    const std::scoped_lock one(asking_);
    std::unique_lock lock(mutex_);
    answer_.reset();
    if (!channel_.send(question)) ::_exit(1);
    came_.wait(lock, [this] { return answer_.has_value(); });
    if (answered != nullptr) *answered = std::exchange(file_, -1);
    return std::move(*answer_);
  }

  int threads() const { return threads_; }
  bool stops() const { return stop_.load(std::memory_order_relaxed); }
  bool given_up() const { return given_up_; }
  bool full() const { return full_; }
  bool watched() const { return watched_; }

 private:
  void take_all() {
    worker::ToWorker message;
    while (channel_.receive(message, -1) == Channel::Got::Message) {
      if (message.has_steering()) steer(message.steering());
      if (!message.has_answer()) continue;
      steer(message.answer().steering());
      const std::scoped_lock lock(mutex_);
      file_ = channel_.take_file();
      answer_ = std::move(*message.mutable_answer());
      came_.notify_all();
    }
    ::_exit(1);
  }
  void steer(const worker::Steering& steering) {
    threads_ = std::max(1, steering.threads());
    given_up_ = steering.given_up();
    full_ = steering.full();
    watched_ = steering.watched();
    stop_ = steering.stop();
  }

  Channel& channel_;
  std::mutex asking_, mutex_;
  std::condition_variable came_;
  std::optional<worker::Answer> answer_;
  int file_ = -1;
  std::atomic<int> threads_ = 1;
  std::atomic<bool> stop_ = false, given_up_ = false, full_ = false, watched_ = false;
};

/// Collects the pieces of an output.
class Output {
 public:
  explicit Output(Conversation& server) : server_(server) {}

  bool add(std::string_view bytes) {
    piece_ += bytes;
    while (piece_.size() >= kPieceBytes) {
      send(piece_.substr(0, kPieceBytes));
      piece_.erase(0, kPieceBytes);
    }
    return !server_.full();
  }
  void end() {
    if (!piece_.empty()) send(std::exchange(piece_, {}));
  }

 private:
  void send(std::string bytes) {
    worker::FromWorker message;
    message.set_output_piece(std::move(bytes));
    server_.say(message);
  }

  Conversation& server_;
  std::string piece_;
};

}  // namespace varimesh::server
