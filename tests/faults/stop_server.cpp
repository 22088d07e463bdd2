// Stops the real server with SIGTERM at random iterations of five running jobs, starts it again each time, and looks
// where each job goes on: at most one iteration before the last that anybody has seen. The results have the bytes of
// undisturbed runs.
//
//   stop_server              50 times; some minutes
//   stop_server --stops 4    the short form (one of the default tests)
//   stop_server --seed 7     another sequence of moments
//
// Exit status: 0: all promises held; 1: some did not, with a line for each.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <map>
#include <mutex>
#include <random>
#include <thread>

#include "tests/faults/caller.h"

namespace varimesh::server::testing {
namespace {

struct Arguments {
  std::string program = VARIMESHD;
  int stops = 50;
  unsigned seed = 1;
};

/// A kind of job: each has other methods, and other state in its checkpoints.
struct Variant {
  const char* name;
  const char* mesh;
  v1::Method method;
  v1::Objective objective;
  int iterations;
};
constexpr Variant kVariants[] = {
    {"sweeps", "circle_p5.msh", v1::METHOD_SWEEPS, v1::OBJECTIVE_ENERGY, 1000},
    {"Newton", "circle_p5.msh", v1::METHOD_NEWTON, v1::OBJECTIVE_ENERGY, 60},
    {"worst", "annulus_p3.msh", v1::METHOD_AUTO, v1::OBJECTIVE_WORST, 200},
    {"accuracy", "circle_p5.msh", v1::METHOD_AUTO, v1::OBJECTIVE_ACCURACY, 200},
    {"untangling", "sphere_p3.msh", v1::METHOD_AUTO, v1::OBJECTIVE_AUTO, 200},
};

/// A job, and what its watcher has seen of each attempt.
struct Watched {
  std::size_t variant = 0;
  std::string name;
  std::mutex mutex;
  std::map<int, std::pair<int, int>> seen;  ///< By attempt: the first and the last iteration.
  std::atomic<int> iterations = 0;          ///< Seen so far, those that were made again included.
  std::atomic<bool> ended = false;
  std::thread watcher;
};

class Campaign {
 public:
  explicit Campaign(const Arguments& arguments)
      : arguments_(arguments),
        server_(arguments.program, {"--threads", "5", "--log-level", "info"}),
        random_(arguments.seed) {}

  int run() {
    server_.start();
    upload();
    learn_results();
    for (int stop = 1; stop <= arguments_.stops; ++stop) {
      top_up();
      const auto variant = std::uniform_int_distribution<std::size_t>(0, std::size(kVariants) - 1)(random_);
      wait_for_iterations(variant, std::uniform_int_distribution<>(1, 12)(random_));
      const auto begun = Clock::now();
      if (server_.stop() != 0) violation("the exit status of the server is not 0");
      slowest_stop_ = std::max(slowest_stop_, milliseconds_since(begun));
      server_.start();
    }
    for (const auto& job : jobs_) job->watcher.join();
    for (const auto& job : jobs_) check(*job);
    server_.stop();
    std::printf("%d stops, %zu jobs, %d attempts continued (", arguments_.stops, jobs_.size(), continued_);
    for (const auto& [name, count] : continued_of_)
      std::printf("%s%s %d", name == continued_of_.begin()->first ? "" : ", ", name.c_str(), count);
    std::printf("), at most %d iterations made again, stopped within %.0f ms: %s\n", furthest_back_, slowest_stop_,
                violations_ == 0 ? "all promises held" : "SOME DID NOT HOLD");
    return violations_ == 0 ? 0 : 1;
  }

 private:
  void violation(const std::string& what) {
    std::printf("VIOLATION: %s\n", what.c_str());
    ++violations_;
  }

  void upload() {
    const Caller caller(server_.channel());
    for (const Variant& variant : kVariants) digests_.push_back(caller.upload(read_case(variant.mesh)));
  }

  v1::JobSpec spec(std::size_t variant) const {
    const Variant& one = kVariants[variant];
    v1::JobSpec spec;
    spec.mutable_mesh()->set_digest(digests_[variant]);
    v1::Options& options = *spec.mutable_options();
    options.set_method(one.method);
    options.set_objective(one.objective);
    options.set_max_iterations(one.iterations);
    options.set_tolerance(1e-13);
    options.set_threads(1);
    if (one.method == v1::METHOD_SWEEPS) options.set_active_set(false);
    return spec;
  }

  /// Runs each variant undisturbed and remembers its result.
  void learn_results() {
    const Caller caller(server_.channel());
    std::vector<std::string> names;
    for (std::size_t variant = 0; variant < std::size(kVariants); ++variant)
      names.push_back(caller.submit(spec(variant)));
    for (const std::string& name : names) {
      v1::Job job;
      caller.wait_for(name, {v1::JOB_STATE_SUCCEEDED, v1::JOB_STATE_FAILED}, &job);
      results_.push_back(job.results_size() == 1 ? job.results(0).digest() : "none");
    }
  }

  /// Sees to it that a job of each variant waits or runs.
  void top_up() {
    const Caller caller(server_.channel());
    for (std::size_t variant = 0; variant < std::size(kVariants); ++variant) {
      const bool is_there =
          std::ranges::any_of(jobs_, [&](const auto& job) { return job->variant == variant && !job->ended; });
      if (is_there) continue;
      auto job = std::make_unique<Watched>();
      job->variant = variant;
      job->name = caller.submit(spec(variant));
      job->watcher = std::thread([this, watched = job.get()] { watch(*watched); });
      jobs_.push_back(std::move(job));
    }
  }

  int iterations(std::size_t variant) const {
    int sum = 0;
    for (const auto& job : jobs_) sum += job->variant == variant ? job->iterations.load() : 0;
    return sum;
  }

  /// Waits until the jobs of a variant have made this many iterations more. Jobs that end meanwhile are replaced.
  void wait_for_iterations(std::size_t variant, int more) {
    const int wanted = iterations(variant) + more;
    const auto begun = Clock::now();
    while (iterations(variant) < wanted && milliseconds_since(begun) < 60'000) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
      top_up();
    }
  }

  void watch(Watched& job) {
    const auto stub = v1::JobService::NewStub(server_.channel());
    std::int64_t last = 0;
    while (true) {
      v1::WatchJobRequest request;
      request.set_name(job.name);
      request.set_after_sequence(last);
      grpc::ClientContext context;
      context.set_wait_for_ready(true);
      const auto reader = stub->WatchJob(&context, request);
      v1::WatchJobResponse response;
      while (reader->Read(&response)) {
        const v1::JobEvent& event = response.event();
        last = event.sequence();
        if (!event.has_iteration()) continue;
        const std::lock_guard lock(job.mutex);
        const int number = event.iteration().number();
        job.seen.try_emplace(event.attempt(), number, number).first->second.second = number;
        ++job.iterations;
      }
      const grpc::Status status = reader->Finish();
      const bool is_away =
          status.error_code() == grpc::StatusCode::UNAVAILABLE || status.error_code() == grpc::StatusCode::CANCELLED;
      if (!status.ok() && !is_away) violation("watch of " + job.name + ": " + status.error_message());
      if (!is_away) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    job.ended = true;
  }

  void check(const Watched& job) {
    const Variant& variant = kVariants[job.variant];
    const v1::Job end = Caller(server_.channel()).get(job.name);
    if (end.state() != v1::JOB_STATE_SUCCEEDED || end.results_size() != 1)
      violation(job.name + " (" + variant.name + ") is " + v1::JobState_Name(end.state()));
    else if (end.results(0).digest() != results_[job.variant])
      violation(job.name + " (" + variant.name + ") has other bytes than an undisturbed run");
    int last = 0;
    for (const auto& [attempt, seen] : job.seen) {
      // An attempt that goes on behind the last iteration begins with the next one.
      const int back = last + 1 - seen.first;
      if (last > 0) {
        ++continued_;
        ++continued_of_[variant.name];
        furthest_back_ = std::max(furthest_back_, back);
        if (back > 1)
          violation(job.name + " (" + variant.name + "): attempt " + std::to_string(attempt) +
                    " begins with iteration " + std::to_string(seen.first) + ", but " + std::to_string(last) +
                    " had been seen");
      }
      last = std::max(last, seen.second);
    }
  }

  const Arguments arguments_;
  RealServer server_;
  std::mt19937 random_;
  std::vector<std::string> digests_, results_;
  std::vector<std::unique_ptr<Watched>> jobs_;
  std::atomic<int> violations_ = 0;
  int continued_ = 0, furthest_back_ = 0;
  std::map<std::string, int> continued_of_;
  double slowest_stop_ = 0;
};

}  // namespace
}  // namespace varimesh::server::testing

int main(int argc, char** argv) {
  using namespace varimesh::server::testing;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  Arguments arguments;
  CLI::App app{"Stops varimeshd again and again, and checks where its jobs go on."};
  app.add_option("--stops", arguments.stops, "How often to stop the server")->capture_default_str();
  app.add_option("--seed", arguments.seed, "Seed of the random moments")->capture_default_str();
  app.add_option("--server", arguments.program, "The varimeshd to stop")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return Campaign(arguments).run();
}
