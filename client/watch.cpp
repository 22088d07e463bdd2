// Watching: a reader that always reads, and the loop that resumes it.
#include <grpcpp/grpcpp.h>

#include <condition_variable>
#include <deque>
#include <mutex>

#include "client/client.h"
#include "client/failures.h"

namespace varimesh::client {
namespace {

/// One WatchJob stream. gRPC's threads read it, whatever the program is doing, so that pings are answered; a bounded
/// queue lies between, and the server thins when it is full.
class Watcher : public grpc::ClientReadReactor<v1::WatchJobResponse> {
 public:
  Watcher(v1::JobService::Stub& stub, const v1::WatchJobRequest& request) : request_(request) {
    stub.async()->WatchJob(&context_, &request_, this);
    StartRead(&response_);
    StartCall();
  }

  ~Watcher() override {
    context_.TryCancel();
    std::unique_lock lock(mutex_);
    closing_ = true;
    if (waiting_) read_on();
    changed_.wait(lock, [this] { return done_; });
  }

  enum class Got { Event, Nothing, Done };
  /// The next event, if one comes in time.
  Got next(v1::JobEvent* event, std::chrono::milliseconds patience) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, patience, [this] { return !events_.empty() || done_; });
    if (events_.empty()) return done_ ? Got::Done : Got::Nothing;
    *event = std::move(events_.front());
    events_.pop_front();
    if (waiting_) read_on();
    return Got::Event;
  }

  /// Once next() has said Done.
  grpc::Status status() {
    std::lock_guard lock(mutex_);
    return status_;
  }

 private:
  static constexpr std::size_t kQueue = 1024;

  void OnReadDone(bool ok) override {
    std::lock_guard lock(mutex_);
    if (!ok) return;
    if (!closing_) events_.push_back(std::move(*response_.mutable_event()));
    changed_.notify_all();
    if (events_.size() < kQueue || closing_)
      StartRead(&response_);
    else if (!std::exchange(waiting_, true))
      AddHold();  // OnDone must not come while no read is under way that would tell.
  }

  /// With the lock held.
  void read_on() {
    waiting_ = false;
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
  bool waiting_ = false;  ///< The queue was full: a read has to be started when it is not.
  bool closing_ = false;
  bool done_ = false;
};

tl::unexpected<Failure> no_such_event(const v1::Job& job, std::int64_t sequence) {
  return tl::unexpected(Failure{Failure::Kind::Refused,
                                "BAD_OPTION",
                                job.name() + " has no event number " + std::to_string(sequence) + ": its last is " +
                                    std::to_string(job.last_sequence()) + "; watch it from there, or from 0.",
                                {}});
}

}  // namespace

Outcome<v1::Job> Client::watch(const std::string& name, std::int64_t after_sequence, const OnEvent& on_event,
                               const std::function<bool()>& on_wait) {
  v1::WatchJobRequest request;
  request.set_name(name);
  request.set_after_sequence(after_sequence);
  std::int64_t seen = after_sequence;
  Patience patience(settings_);
  while (true) {
    Watcher watcher(*jobs_, request);
    v1::JobEvent event;
    Watcher::Got got = Watcher::Got::Nothing;
    while (got != Watcher::Got::Done) {
      if (on_wait && !on_wait())
        return tl::unexpected(Failure{Failure::Kind::Interrupted, "", "The watching of " + name + " was stopped.", {}});
      got = watcher.next(&event, std::chrono::milliseconds(100));
      if (got != Watcher::Got::Event) continue;
      patience.reset();
      if (event.sequence() < seen || (event.sequence() == seen && !event.has_bookmark())) continue;
      seen = event.sequence();
      request.set_after_sequence(seen);
      if (!on_event(event)) return get(name);
    }
    const grpc::Status status = watcher.status();
    if (status.ok()) return get(name);
    const Failure failure = failure_of(status);
    if (failure.reason == "SEQUENCE_EXPIRED" && request.after_sequence() != 0) {
      if (seen == after_sequence) {
        auto job = get(name);
        if (!job) return job;
        if (job->last_sequence() < after_sequence) return no_such_event(*job, after_sequence);
      }
      // The server dropped some iterations behind it. From the start on it has every state and all it still keeps; what
      // was seen before is passed over.
      request.set_after_sequence(0);
      continue;
    }
    if (!patience.again(status)) return tl::unexpected(failure);
  }
}

}  // namespace varimesh::client
