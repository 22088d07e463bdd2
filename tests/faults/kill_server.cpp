// Ends the real server at random moments while jobs wait and run and clients submit and watch: two times out of three
// by SIGKILL, otherwise by SIGTERM. Starts the server again each time, and compares what the clients saw with what the
// service promises.
//
//   kill_server                      100 times, with 20 jobs at a time; some minutes
//   kill_server --kills 6 --jobs 6   the short form (one of the default tests)
//   kill_server --seed 7             another sequence of moments
//   kill_server --store URL          with the jobs in a PostgreSQL database, which must have its tables
//
// Exit status: 0: all promises held; 1: some did not, with a line for each.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <cstdio>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <thread>

#include "tests/faults/caller.h"
#include "tests/server/watch_guarantees.h"

namespace varimesh::server::testing {
namespace {

struct Arguments {
  std::string program = VARIMESHD;
  std::string mesh = VARIMESH_SOURCE_DIR "/tests/cases/circle_p5.msh";
  int kills = 100;
  int jobs = 20;
  unsigned seed = 1;
  std::string store;  ///< Empty: the state directory.
};

std::vector<std::string> flags_of(const Arguments& arguments) {
  std::vector<std::string> flags{"--threads", "2", "--log-level", "info", "--checkpoint-seconds", "0.05"};
  if (!arguments.store.empty()) flags.insert(flags.end(), {"--store", arguments.store, "--lease-seconds", "3"});
  return flags;
}

/// Prints and counts the promises that did not hold.
class Violations {
 public:
  void add(const std::string& what) {
    std::lock_guard lock(mutex_);
    std::printf("VIOLATION: %s\n", what.c_str());
    ++count_;
  }
  void expect(const std::string& broken, const std::string& where) {
    if (!broken.empty()) add(where + ": " + broken);
  }
  int count() const { return count_; }

 private:
  std::mutex mutex_;
  std::atomic<int> count_ = 0;
};

/// Returns whether the server is away, so that a client waits and tries again. gRPC answers CANCELLED to a call that
/// arrives while the server shuts down (service.proto).
bool is_away(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::UNAVAILABLE || status.error_code() == grpc::StatusCode::CANCELLED;
}

/// Longest time between two ends of the server, in milliseconds. Jobs must reach a checkpoint in it, also under a
/// sanitizer.
#if defined(__SANITIZE_ADDRESS__)
constexpr int kLongestLife = 15000;
#else
constexpr int kLongestLife = 1200;
#endif

void pause() { std::this_thread::sleep_for(std::chrono::milliseconds(10)); }

/// Repeats a call until the server answers it.
template <class Call>
grpc::Status persist(const Call& call) {
  while (true) {
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    const grpc::Status status = call(context);
    if (!is_away(status)) return status;
    pause();
  }
}

/// A job that the server has accepted, and the thread that watches it to its end.
struct Watched {
  std::string name;
  std::string request_id;
  int variant = 0;
  WatchHistory history{1};
  std::atomic<bool> ended = false;
  std::thread watcher;
};

/// Runs the whole test.
class Campaign {
 public:
  explicit Campaign(const Arguments& arguments)
      : arguments_(arguments),
        server_(arguments.program, flags_of(arguments)),
        random_(arguments.seed),
        mesh_(read_file(arguments.mesh)) {}

  int run() {
    server_.start();
    jobs_stub_ = v1::JobService::NewStub(server_.channel());
    upload();
    learn_results();
    for (int kill = 1; kill <= arguments_.kills; ++kill) {
      std::thread client([&] { top_up(); });  // the server may end while this runs
      std::this_thread::sleep_for(std::chrono::milliseconds(std::uniform_int_distribution<>(0, kLongestLife)(random_)));
      if (kill % 3 == 0)
        stop_gently();
      else
        server_.kill();
      const auto took = server_.start();
      slowest_start_ = std::max(slowest_start_, took);
      if (took > std::chrono::seconds(5)) violations_.add("ready after " + std::to_string(took.count()) + " ms");
      client.join();
    }
    for (const auto& watched : watched_) watched->watcher.join();
    check();
    stop_gently();
    std::printf(
        "%d ends, %zu jobs, %d attempts lost, %d continued from a checkpoint, %d jobs lost three times, ready again "
        "within %lld ms, stopped within %lld ms: %s\n",
        arguments_.kills, watched_.size(), lost_attempts_, resumed_, given_up_,
        static_cast<long long>(slowest_start_.count()), static_cast<long long>(slowest_stop_.count()),
        violations_.count() == 0 ? "all promises held" : "SOME DID NOT HOLD");
    return violations_.count() == 0 ? 0 : 1;
  }

 private:
  void stop_gently() {
    const auto begun = std::chrono::steady_clock::now();
    if (const int status = server_.stop(); status != 0)
      violations_.add("exit status " + std::to_string(status) + " after SIGTERM");
    const auto took = std::chrono::steady_clock::now() - begun;
    slowest_stop_ = std::max(slowest_stop_, std::chrono::duration_cast<std::chrono::milliseconds>(took));
    if (took > std::chrono::seconds(30)) violations_.add("the server took more than 30 s to stop");
  }

  // ===== clients =====

  void upload() {
    if (const auto status = Caller(server_.channel()).try_upload(mesh_, &digest_); !status.ok())
      violations_.add("upload: " + status.error_message());
  }

  v1::JobSpec spec(int variant) const {
    v1::JobSpec spec;
    spec.mutable_mesh()->set_digest(digest_);
    v1::Options& options = *spec.mutable_options();
    options.set_max_iterations(10 + 8 * variant);
    // Every other job does sweeps for some seconds, so that it has a checkpoint to continue from.
    if (variant % 2 == 1) {
      options.set_method(v1::METHOD_SWEEPS);
      options.set_active_set(false);
      options.set_max_iterations(200 * variant);
    }
    options.set_tolerance(1e-12);
    options.set_threads(1);
    return spec;
  }

  /// Runs each variant undisturbed and remembers its result.
  void learn_results() {
    for (int variant = 0; variant < kVariants; ++variant) submit(variant);
    for (const auto& watched : watched_) {
      watched->watcher.join();
      results_[watched->variant] = get(watched->name).results(0).digest();
      watched->watcher = std::thread([] {});
    }
  }

  void submit(int variant) {
    auto watched = std::make_unique<Watched>();
    watched->variant = variant;
    watched->request_id = "request " + std::to_string(++requests_);
    v1::SubmitJobRequest request;
    request.set_request_id(watched->request_id);
    *request.mutable_spec() = spec(variant);
    v1::SubmitJobResponse response;
    const auto status =
        persist([&](grpc::ClientContext& context) { return jobs_stub_->SubmitJob(&context, request, &response); });
    if (!status.ok()) return violations_.add("submission: " + status.error_message());
    watched->name = response.job().name();
    watched->watcher = std::thread([this, job = watched.get()] { watch(*job); });
    watched_.push_back(std::move(watched));
  }

  /// Submits jobs until as many wait and run as were asked for.
  void top_up() {
    std::size_t unfinished = 0;
    for (const auto& watched : watched_) unfinished += watched->ended ? 0 : 1;
    for (; unfinished < static_cast<std::size_t>(arguments_.jobs); ++unfinished) submit(requests_ % kVariants);
  }

  void watch(Watched& job) {
    const auto stub = v1::JobService::NewStub(server_.channel());
    while (true) {
      v1::WatchJobRequest request;
      request.set_name(job.name);
      request.set_after_sequence(job.history.back().after_sequence);
      grpc::ClientContext context;
      context.set_wait_for_ready(true);
      const auto reader = stub->WatchJob(&context, request);
      v1::WatchJobResponse response;
      std::int64_t last = request.after_sequence();
      while (reader->Read(&response)) {
        last = response.event().sequence();
        job.history.back().events.push_back(std::move(*response.mutable_event()));
      }
      const grpc::Status status = reader->Finish();
      if (!status.ok() && !is_away(status)) violations_.add("watch of " + job.name + ": " + status.error_message());
      if (!is_away(status)) break;
      job.history.push_back({last, {}});
      pause();
    }
    job.ended = true;
  }

  v1::Job get(const std::string& name) {
    v1::GetJobRequest request;
    request.set_name(name);
    v1::GetJobResponse response;
    const auto status =
        persist([&](grpc::ClientContext& context) { return jobs_stub_->GetJob(&context, request, &response); });
    if (!status.ok()) violations_.add(name + ": " + status.error_message());
    return response.job();
  }

  // ===== checks =====

  void check() {
    std::multiset<std::string> requests;
    v1::ListJobsRequest list;
    do {
      v1::ListJobsResponse page;
      persist([&](grpc::ClientContext& context) { return jobs_stub_->ListJobs(&context, list, &page); });
      for (const v1::Job& job : page.jobs()) requests.insert(job.request_id());
      list.set_page_token(page.next_page_token());
    } while (!list.page_token().empty());
    for (const auto& watched : watched_) {
      if (requests.count(watched->request_id) != 1)
        violations_.add(watched->request_id + " has " + std::to_string(requests.count(watched->request_id)) + " jobs");
      check(*watched);
    }
    if (lost_attempts_ >= kFewAttempts && resumed_ == 0) violations_.add("no attempt continued from a checkpoint");
  }

  /// Returns the number of attempts after the first that continued from a checkpoint, by the first iteration that was
  /// seen of each.
  static int resumed(const WatchHistory& history) {
    std::map<int, int> first;
    for (const WatchedStream& stream : history)
      for (const v1::JobEvent& event : stream.events)
        if (event.has_iteration()) first.emplace(event.attempt(), event.iteration().number());
    return static_cast<int>(std::count_if(first.begin(), first.end(), [](const auto& attempt) {
      return attempt.first > 1 && attempt.second > 1 && (attempt.second - 1) % 10 == 0;
    }));
  }

  void check(const Watched& watched) {
    const v1::Job job = get(watched.name);
    if (job.state() == v1::JOB_STATE_SUCCEEDED) {
      if (job.results_size() != 1)
        violations_.add(job.name() + " has " + std::to_string(job.results_size()) + " results");
      else if (job.results(0).digest() != results_[watched.variant])
        violations_.add(job.name() + " has other bytes than an undisturbed run");
    } else if (job.error().reason() == "LOST" && job.attempt() >= 3) {
      ++given_up_;
    } else {
      violations_.add(job.name() + " is " + v1::JobState_Name(job.state()) + ": " + job.error().message());
    }
    lost_attempts_ += std::max(0, job.attempt() - 1);
    resumed_ += resumed(watched.history);

    // What the server itself has recorded, with every state and quality report.
    Watched again;
    again.name = watched.name;
    watch(again);
    std::vector<v1::JobEvent> truth;
    int ends = 0;
    for (const v1::JobEvent& event : again.history.back().events) {
      truth.push_back(event);
      ends += event.state_change().state() == v1::JOB_STATE_SUCCEEDED ? 1 : 0;
    }
    if (ends > 1) violations_.add(job.name() + " succeeded " + std::to_string(ends) + " times");
    violations_.expect(broken_order(watched.history), job.name());
    violations_.expect(broken_uniqueness(watched.history), job.name());
    violations_.expect(broken_reliability(watched.history, truth), job.name());
    violations_.expect(broken_resumption(watched.history), job.name());
    violations_.expect(invented(watched.history, truth), job.name());
  }

  /// Reports a state or quality report that was seen but that the server has not recorded.
  static std::string invented(const WatchHistory& history, const std::vector<v1::JobEvent>& truth) {
    std::set<std::int64_t> happened;
    for (const v1::JobEvent& event : truth) happened.insert(event.sequence());
    for (const WatchedStream& stream : history)
      for (const v1::JobEvent& event : stream.events)
        if (must_be_delivered(event) && happened.count(event.sequence()) == 0)
          return "event " + std::to_string(event.sequence()) + " was seen but is no longer known";
    return {};
  }

  static constexpr int kVariants = 6;
  static constexpr int kFewAttempts = 5;  ///< This many may all have been lost in their first ten iterations.

  const Arguments arguments_;
  RealServer server_;
  std::mt19937 random_;
  std::string mesh_, digest_;
  std::unique_ptr<v1::JobService::Stub> jobs_stub_;
  Violations violations_;
  std::map<int, std::string> results_;
  std::vector<std::unique_ptr<Watched>> watched_;
  int requests_ = 0, lost_attempts_ = 0, resumed_ = 0, given_up_ = 0;
  std::chrono::milliseconds slowest_start_{0}, slowest_stop_{0};
};

}  // namespace
}  // namespace varimesh::server::testing

int main(int argc, char** argv) {
  using namespace varimesh::server::testing;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  Arguments arguments;
  CLI::App app{"Ends varimeshd again and again, and checks that nothing is lost."};
  app.add_option("--kills", arguments.kills, "How often to end the server")->capture_default_str();
  app.add_option("--jobs", arguments.jobs, "Jobs that wait or run at any time")->capture_default_str();
  app.add_option("--seed", arguments.seed, "Seed of the random moments")->capture_default_str();
  app.add_option("--server", arguments.program, "The varimeshd to end")->capture_default_str();
  app.add_option("--store", arguments.store, "The address of the database of the jobs");
  app.add_option("--mesh", arguments.mesh, "The mesh of the jobs")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  return Campaign(arguments).run();
}
