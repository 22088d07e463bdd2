// The writing half of a stream: it writes one message at a time, prepares the next on the pool, and decides who
// finishes the stream. It does not use gRPC's calls, so it can be tested without them.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "server/limits.h"
#include "server/resources/pool.h"
#include "server/streams/status.h"

namespace varimesh::server {

/// The answer of a source: a message, nothing at the moment, the end of the stream, or that it has worked for a while
/// and is to be asked again, when others have had their turn.
enum class Pull { Message, Wait, End, Again };

/// Writes the messages of a source one after another and finishes the stream. The reactor that owns the pump forwards
/// its reactions to it. As in gRPC's orca_service.cc, the lock is held while it is decided who finishes the stream.
template <class Response>
class Pump {
 public:
  /// Fills in the next message. Called on the pool, by one thread at a time. If it returns Wait, poke() must be called
  /// when there may be more. `idle`: a bookmark is due, which a source that has bookmarks returns as a message.
  using Source = std::function<Pull(Response*, bool idle, grpc::Status*)>;
  struct Stream {
    std::function<void(const Response*)> write;
    std::function<void(const grpc::Status&)> finish;
    std::function<void()> cancel;
  };

  /// `caller`: whose turn at the pool it is.
  Pump(Pool& pool, const Limits& limits, Stream stream, std::string caller = {})
      : pool_(pool), limits_(limits), stream_(std::move(stream)), caller_(std::move(caller)) {}

  /// Begins to write. Before this call only end() has an effect. `owner` is the reactor, which is kept alive while the
  /// pool works for it.
  void start(std::weak_ptr<void> owner, Source source) {
    std::lock_guard lock(mutex_);
    owner_ = std::move(owner);
    source_ = std::move(source);
    last_write_ = std::chrono::steady_clock::now();
    if (!finished_) pull_soon();
  }

  void poke() {
    std::lock_guard lock(mutex_);
    if (source_ == nullptr || finished_) return;
    if (state_ == State::Idle)
      pull_soon();
    else
      poked_ = true;
  }

  void on_write_done(bool ok) {
    std::lock_guard lock(mutex_);
    if (finished_) return;
    last_write_ = std::chrono::steady_clock::now();
    if (ok)
      pull_soon();
    else
      finish(grpc::Status(grpc::StatusCode::CANCELLED, "The stream was cut."));
  }

  void end(const grpc::Status& status) {
    std::lock_guard lock(mutex_);
    if (!finished_) finish(status);
  }

  bool finished() {
    std::lock_guard lock(mutex_);
    return finished_;
  }

  /// Calls `act`, such as the start of a read, if the stream is not finished.
  void unless_finished(const std::function<void()>& act) {
    std::lock_guard lock(mutex_);
    if (!finished_) act();
  }

  /// Cancels the stream if its client does not read, and asks the source for a bookmark if nothing was written for
  /// long.
  void tick(std::chrono::steady_clock::time_point now) {
    std::lock_guard lock(mutex_);
    if (source_ == nullptr || finished_) return;
    if (state_ == State::Writing && now - last_write_ > limits_.stalled_reader) stream_.cancel();
    if (state_ == State::Idle && now - last_write_ > limits_.bookmark_interval) {
      idle_ = true;
      pull_soon();
    }
  }

 private:
  enum class State { Idle, Pulling, Writing };

  /// Requires the lock.
  void pull_soon() {
    state_ = State::Pulling;
    poked_ = false;
    pool_.post(
        [this, alive = owner_.lock()] {
          if (alive != nullptr) pull();
        },
        caller_);
  }

  void pull() {
    bool idle = false;
    {
      std::lock_guard lock(mutex_);
      if (finished_) return;
      idle = std::exchange(idle_, false);
    }
    response_.Clear();
    Pull got = Pull::End;
    const grpc::Status status = guarded([&] {
      grpc::Status result;
      got = source_(&response_, idle, &result);
      return result;
    });
    std::lock_guard lock(mutex_);
    if (finished_) return;
    if (!status.ok() || got == Pull::End) {
      finish(status);
    } else if (got == Pull::Message) {
      state_ = State::Writing;
      last_write_ = std::chrono::steady_clock::now();
      stream_.write(&response_);
    } else if (poked_ || got == Pull::Again) {
      pull_soon();
    } else {
      state_ = State::Idle;
    }
  }

  /// Requires the lock.
  void finish(const grpc::Status& status) {
    finished_ = true;
    stream_.finish(status);
  }

  Pool& pool_;
  const Limits& limits_;
  const Stream stream_;
  const std::string caller_;
  std::mutex mutex_;
  std::weak_ptr<void> owner_;
  Source source_;
  Response response_;  ///< Used by the thread that pulls, and by gRPC while it is written.
  State state_ = State::Idle;
  bool poked_ = false;
  bool idle_ = false;
  bool finished_ = false;
  std::chrono::steady_clock::time_point last_write_;
};

}  // namespace varimesh::server
