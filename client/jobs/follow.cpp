#include "client/jobs/follow.h"

#include <chrono>
#include <iostream>
#include <optional>

#include "client/io/progress.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"

namespace varimesh::client {

tl::expected<v1::Job, int> follow(Client* client, const std::string& name, std::int64_t after, const CommonFlags& flags,
                                  OnInterrupt on_interrupt) {
  const bool cancels = on_interrupt == OnInterrupt::CancelJob;
  v1::Options options;
  // If the job has to be cancelled, an interrupt before this call succeeds must still lead to the code below.
  if (const auto job = client->get(name))
    options = job->spec().options();
  else if (!cancels || interrupt_count() == 0)
    return tl::unexpected(print_error(job.error()));
  Progress progress(flags.quiet, options);

  // A job in this process ends before the process can. For a server, waiting for a while after the cancellation is
  // enough.
  const std::chrono::seconds patience = flags.server.empty() ? std::chrono::hours(24) : std::chrono::seconds(10);
  std::optional<std::chrono::steady_clock::time_point> cancelled;
  const auto on_event = [&](const v1::JobEvent& event) {
    progress.show(event);
    return true;
  };
  const auto on_wait = [&] {
    if (interrupt_count() == 0) return true;
    if (!cancels) return false;
    if (cancelled) return std::chrono::steady_clock::now() < *cancelled + patience;
    cancelled = std::chrono::steady_clock::now();
    progress.print("varimesh: interrupted; cancelling " + name);
    const auto answer = client->cancel(name);
    if (!answer) progress.print("varimesh: " + answer.error().sentence);
    return answer.has_value();
  };
  auto ended = client->watch(name, after, on_event, on_wait);
  if (ended) return *ended;
  if (interrupt_count() == 0) return tl::unexpected(print_error(ended.error()));
  std::cerr << "varimesh: interrupted; " << name
            << (cancels ? " may still be running on the server" : " goes on running") << std::endl;
  return tl::unexpected(static_cast<int>(kInterrupted));
}

}  // namespace varimesh::client
