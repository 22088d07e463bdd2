// Watching a job: one stream of events, and the loop that resumes the stream when it breaks.
#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <deque>
#include <mutex>

#include "client/client.h"
#include "client/library/authorisation.h"
#include "client/library/failures.h"
#include "client/library/retry_policy.h"

namespace varimesh::client {
namespace {

/// One WatchJob stream. gRPC's threads read it into a bounded queue, whatever the program is doing, so that the
/// connection stays alive. When the queue is full, reading pauses and the server thins out the events.
class EventStream : public grpc::ClientReadReactor<v1::WatchJobResponse> {
 public:
  EventStream(v1::JobService::Stub& stub, const v1::WatchJobRequest& request, const Settings& settings)
      : request_(request) {
    authorise(settings, &context_);
    stub.async()->WatchJob(&context_, &request_, this);
    StartRead(&response_);
    StartCall();
  }

  ~EventStream() override {
    context_.TryCancel();
    std::unique_lock lock(mutex_);
    closing_ = true;
    if (paused_) resume_reading();
    changed_.wait(lock, [this] { return done_; });
  }

  enum class Next { Event, Timeout, End };
  /// Waits for the next event, for at most `timeout`.
  Next next(v1::JobEvent* event, std::chrono::milliseconds timeout) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, timeout, [this] { return !events_.empty() || done_; });
    if (events_.empty()) return done_ ? Next::End : Next::Timeout;
    *event = std::move(events_.front());
    events_.pop_front();
    if (paused_) resume_reading();
    return Next::Event;
  }

  /// How the stream ended. Call it after next() has returned End.
  grpc::Status status() {
    std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  static constexpr std::size_t kMostQueued = 1024;

  void OnReadDone(bool ok) override {
    std::lock_guard lock(mutex_);
    if (!ok) return;
    if (!closing_) events_.push_back(std::move(*response_.mutable_event()));
    changed_.notify_all();
    if (events_.size() < kMostQueued || closing_)
      StartRead(&response_);
    else if (!std::exchange(paused_, true))
      AddHold();  // Keeps OnDone() from being called while no read is under way.
  }

  /// The caller holds the lock.
  void resume_reading() {
    paused_ = false;
    StartRead(&response_);
    RemoveHold();
  }

  void OnDone(const grpc::Status& status) override {
    std::lock_guard lock(mutex_);
    status_ = status;
    done_ = true;
    changed_.notify_all();
  }

  grpc::ClientContext context_;
  const v1::WatchJobRequest request_;
  v1::WatchJobResponse response_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<v1::JobEvent> events_;
  grpc::Status status_;
  bool paused_ = false;  ///< The queue was full; reading resumes when it no longer is.
  bool closing_ = false;
  bool done_ = false;
};

tl::unexpected<Failure> no_such_event(const v1::Job& job, std::int64_t sequence) {
  return refusal("BAD_OPTION", job.name() + " has no event number " + std::to_string(sequence) + ": its last is " +
                                   std::to_string(job.last_sequence()) + "; watch it from there, or from 0.");
}

}  // namespace

Outcome<v1::Job> Client::watch(const std::string& name, std::int64_t after_sequence, const OnEvent& on_event,
                               const std::function<bool()>& on_wait) {
  v1::WatchJobRequest request;
  request.set_name(name);
  request.set_after_sequence(after_sequence);
  std::int64_t seen = after_sequence;
  RetryPolicy retries(settings_);
  while (true) {
    EventStream stream(*jobs_, request, settings_);
    v1::JobEvent event;
    auto next = EventStream::Next::Timeout;
    while (next != EventStream::Next::End) {
      if (on_wait && !on_wait()) return interruption("Watching " + name + " was stopped.");
      next = stream.next(&event, std::chrono::milliseconds(100));
      if (next != EventStream::Next::Event) continue;
      retries.server_answered();
      if (event.sequence() < seen || (event.sequence() == seen && !event.has_bookmark())) continue;
      seen = event.sequence();
      request.set_after_sequence(seen);
      if (!on_event(event)) return get(name);
    }
    const grpc::Status status = stream.status();
    if (status.ok()) return get(name);
    const Failure failure = failure_of(status);
    if (failure.reason == "SEQUENCE_EXPIRED" && request.after_sequence() != 0) {
      if (seen == after_sequence) {
        auto job = get(name);
        if (!job) return job;
        if (job->last_sequence() < after_sequence) return no_such_event(*job, after_sequence);
      }
      // The server no longer has some of the iterations after this event. From 0 on it sends every change of state and
      // all iterations that it still has. Events that were delivered before are skipped above.
      request.set_after_sequence(0);
      continue;
    }
    if (!retries.wait_to_retry(status)) return tl::unexpected(failure);
  }
}

}  // namespace varimesh::client
