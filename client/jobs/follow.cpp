#include "client/jobs/follow.h"

#include <unistd.h>

#include <chrono>
#include <iostream>
#include <optional>

#include "client/io/progress.h"
#include "client/jobs/slide_trials.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"

namespace varimesh::client {
namespace {

std::string way_back(const std::string& name, const CommonFlags& flags) {
  return "  varimesh watch " + name + " --server " + flags.server + "\n  varimesh result " + name + " --server " +
         flags.server + " -o OUT";
}

/// Asks whether to cancel the job. False if standard input or standard error is no terminal, and for SIGTERM.
bool is_to_be_cancelled(const std::string& name, const CommonFlags& flags) {
  if (!interrupted_by_user() || isatty(STDIN_FILENO) != 1 || isatty(STDERR_FILENO) != 1) return false;
  // A second Ctrl-C ends the process here and leaves the job running, so the way back comes first.
  std::cerr << "varimesh: interrupted; " << name << " is running on " << flags.server << ". To come back to it:\n"
            << way_back(name, flags) << "\nLeave it running, or cancel it and fetch the best mesh so far? [L/c] "
            << std::flush;
  std::string answer;
  return std::getline(std::cin, answer) && (answer == "c" || answer == "C" || answer == "cancel");
}

/// Follows one job, and does what an interrupt asks for.
class Follower {
 public:
  Follower(Client* client, const std::string& name, const CommonFlags& flags, OnInterrupt on_interrupt,
           const v1::JobSpec& spec)
      : client_(client),
        name_(name),
        flags_(flags),
        on_interrupt_(on_interrupt),
        geometry_(spec.geometry()),
        progress_(flags.quiet, spec.options(), on_interrupt == OnInterrupt::EndJob ? Follows::Run : Follows::Job) {}

  void show(const v1::JobEvent& event) {
    progress_.show(event);
    if (!event.has_slide_trial()) return;
    if (const std::string text = trial_text(event.slide_trial(), geometry_); !text.empty()) progress_.print(text);
  }

  /// Called several times per second: whether to go on following.
  bool goes_on() {
    if (!interrupted()) return true;
    if (cancelled_) return std::chrono::steady_clock::now() < *cancelled_ + patience();
    if (on_interrupt_ == OnInterrupt::EndJob) return end_job();
    progress_.clear_bar();
    if (on_interrupt_ == OnInterrupt::LeaveJob || !is_to_be_cancelled(name_, flags_)) return false;
    keep_calls_going();
    return cancel("cancelling " + name_);
  }

  /// Why following ended before the job did.
  int status_of(const Failure& failure) {
    if (!interrupted()) return print_error(failure);
    progress_.clear_bar();
    if (cancelled_)
      std::cerr << "varimesh: interrupted; " << name_ << " may still be running on the server" << std::endl;
    else
      std::cerr << "varimesh: interrupted; " << name_ << " goes on running on " << flags_.server
                << ". To come back to it:\n"
                << way_back(name_, flags_) << std::endl;
    return kInterrupted;
  }

 private:
  /// A job of this process ends before the process can. For a server, waiting for a while after the cancellation is
  /// enough.
  std::chrono::seconds patience() const {
    return on_interrupt_ == OnInterrupt::EndJob ? std::chrono::hours(24) : std::chrono::seconds(10);
  }

  /// A job that waits would be cancelled without a result. In this process it begins at once.
  bool end_job() {
    const auto job = client_->get(name_);
    if (job && job->state() == v1::JOB_STATE_PENDING) return true;
    return cancel("interrupted; the run ends and its best mesh is written. A second Ctrl-C ends it without a result");
  }

  bool cancel(const std::string& message) {
    cancelled_ = std::chrono::steady_clock::now();
    progress_.print("varimesh: " + message);
    const auto answer = client_->cancel(name_);
    if (!answer) progress_.print("varimesh: " + answer.error().sentence);
    return answer.has_value();
  }

  Client* client_;
  const std::string& name_;
  const CommonFlags& flags_;
  const OnInterrupt on_interrupt_;
  const v1::Geometry geometry_;
  Progress progress_;
  std::optional<std::chrono::steady_clock::time_point> cancelled_;
};

}  // namespace

tl::expected<v1::Job, int> follow(Client* client, const std::string& name, std::int64_t after, const CommonFlags& flags,
                                  OnInterrupt on_interrupt) {
  v1::JobSpec spec;
  // An interrupt before this call succeeds must still do what it is to do.
  if (const auto job = client->get(name))
    spec = job->spec();
  else if (on_interrupt == OnInterrupt::LeaveJob || !interrupted())
    return tl::unexpected(print_error(job.error()));
  Follower follower(client, name, flags, on_interrupt, spec);
  const auto on_event = [&](const v1::JobEvent& event) {
    follower.show(event);
    return true;
  };
  auto ended = client->watch(name, after, on_event, [&] { return follower.goes_on(); });
  if (ended) return *ended;
  return tl::unexpected(follower.status_of(ended.error()));
}

}  // namespace varimesh::client
