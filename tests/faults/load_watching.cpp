// Trials of watchers.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <limits>
#include <mutex>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <utility>

#include "core/optimise/optimiser.h"
#include "tests/faults/load.h"

namespace varimesh::server::testing {
namespace {

/// The connections to the server's socket that it has not closed: their numbers in /proc/net/unix (inodes), whose lines
/// are "Num RefCount Protocol Flags Type St Inode Path". The server's sockets to its worker processes have no path.
std::set<std::string> connections(const RealServer& server) {
  constexpr const char* kConnected = "03";
  const std::string path = server.folder() / "socket";
  std::set<std::string> inodes;
  std::ifstream sockets("/proc/net/unix");
  for (std::string line; std::getline(sockets, line);) {
    std::istringstream words(line);
    std::array<std::string, 8> word;
    for (std::string& one : word) words >> one;
    if (word[5] == kConnected && word[7] == path) inodes.insert(word[6]);
  }
  return inodes;
}

/// Those of `some` that stay for three looks. The server has one more for a moment when it dials itself.
std::set<std::string> lasting(const RealServer& server, std::set<std::string> some) {
  for (int look = 0; look < 3 && !some.empty(); ++look) {
    const std::set<std::string> open = connections(server);
    for (auto one = some.begin(); one != some.end();) one = open.count(*one) > 0 ? std::next(one) : some.erase(one);
    std::this_thread::sleep_for(std::chrono::milliseconds(150));
  }
  return some;
}

/// The connections that were made after `before` and stay.
std::set<std::string> lasting_since(const RealServer& server, const std::set<std::string>& before) {
  std::set<std::string> later = connections(server);
  for (const std::string& one : before) later.erase(one);
  return lasting(server, std::move(later));
}

/// Another process, started before this process has threads, and ended by SIGKILL.
class OtherProcess {
 public:
  explicit OtherProcess(std::vector<std::string> words) {
    process_ = ::fork();
    if (process_ != 0) return;
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    std::freopen("/dev/null", "w", stderr);
    ::execv(arguments[0], arguments.data());
    ::_exit(127);
  }
  ~OtherProcess() { kill(); }
  void kill() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
    process_ = -1;
  }

 private:
  pid_t process_ = -1;
};

void client_killed_in_mid_watch(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {"--threads", "2"});
  server.start();
  const Caller caller(server.channel());
  const std::string job = caller.submit(sweeps(caller.upload(read_case("circle_p5.msh")), 100'000));
  caller.wait_for_an_iteration(job);
  const std::set<std::string> before = connections(server);
  OtherProcess client({VARIMESH, "watch", job, "--server", "unix:" + (server.folder() / "socket").string(), "--quiet"});
  const auto started = Clock::now();
  std::set<std::string> of_client;
  while (of_client.empty() && milliseconds_since(started) < 10'000) of_client = lasting_since(server, before);
  verdict.expect(!of_client.empty(), "a client watches the job");
  const auto killed = Clock::now();
  client.kill();
  const auto freed = [&] {
    const std::set<std::string> open = connections(server);
    return std::none_of(of_client.begin(), of_client.end(),
                        [&](const std::string& one) { return open.count(one) > 0; });
  };
  while (!freed() && milliseconds_since(killed) < 10'000) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  verdict.expect(freed(), "the client is killed, and its stream is freed after " +
                              std::to_string(milliseconds_since(killed)) + " ms");
  const auto last = caller.get(job).last_sequence();
  const auto asked = Clock::now();
  bool continues = false;
  for (; !continues && milliseconds_since(asked) < 30'000; std::this_thread::sleep_for(std::chrono::milliseconds(5)))
    continues = caller.get(job).last_sequence() > last;
  verdict.expect(continues && caller.get(job).state() == v1::JOB_STATE_RUNNING, "the job continues");
}

/// Opens a watch with a window of a few KiB and does not read from it.
class StalledWatcher {
 public:
  StalledWatcher(const RealServer& server, const std::string& job) {
    grpc::ChannelArguments arguments;
    arguments.SetInt("grpc.http2.bdp_probe", 0);
    arguments.SetInt("grpc.http2.lookahead_bytes", 4096);
    arguments.SetInt("varimesh.channel", 1'000'000);
    stub_ = v1::JobService::NewStub(grpc::CreateCustomChannel("unix:" + (server.folder() / "socket").string(),
                                                              grpc::InsecureChannelCredentials(), arguments));
    v1::WatchJobRequest request;
    request.set_name(job);
    reader_ = stub_->WatchJob(&context_, request);
  }
  /// Reads what has arrived, to the end of the stream, and returns its status.
  grpc::Status end() {
    v1::WatchJobResponse response;
    while (reader_->Read(&response)) {
    }
    return reader_->Finish();
  }

 private:
  std::unique_ptr<v1::JobService::Stub> stub_;
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<v1::WatchJobResponse>> reader_;
};

void watcher_that_stops_reading(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {"--threads", "2", "--max-job-iterations", "1000000"});
  server.start();
  const Caller caller(server.channel());
  // This job has many iterations per second, so there is much to send. With a large λ it converges slowly.
  v1::JobSpec spec = sweeps(caller.upload(read_case("nine_triangles.msh")), 1'000'000);
  spec.mutable_options()->set_lambda(1e4);
  const std::string job = caller.submit(spec);
  caller.wait_for_an_iteration(job);
  std::atomic<std::int64_t> seen = 0, iterations = 0;
  grpc::ClientContext other_context;
  std::thread other([&, channel = server.channel()] {
    v1::WatchJobRequest request;
    request.set_name(job);
    const auto reader = v1::JobService::NewStub(channel)->WatchJob(&other_context, request);
    v1::WatchJobResponse response;
    for (; reader->Read(&response); ++seen)
      if (response.event().has_iteration()) iterations = response.event().iteration().number();
    reader->Finish();
  });
  std::this_thread::sleep_for(
      std::chrono::seconds(setting.short_form ? 1 : 20));  // now the log has as many iterations as it keeps
  // The history of the job grows by some hundred MiB in this time and is subtracted. While its storage is moved, the
  // old and the new copy exist for some milliseconds, so the smallest value of each half second counts.
  const auto without_history = [&] {
    double least = std::numeric_limits<double>::infinity();
    for (const auto half = Clock::now(); milliseconds_since(half) < 500;) {
      const double history = double(iterations) * sizeof(varimesh::Iteration);
      least = std::min(least, double(memory_kib(server.process(), "VmRSS")) / 1024 - history / (1 << 20));
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return least;
  };
  const double before = without_history();
  const auto begun = Clock::now();
  StalledWatcher stalled(server, job);
  double most = before;
  const double patience = setting.short_form ? 2'000 : 30'000;
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  const std::int64_t seen_before = seen;
  while (milliseconds_since(begun) < patience) most = std::max(most, without_history());
  verdict.expect_at_most(most - before, 16, "MiB", "additional memory for a watcher that does not read");
  verdict.expect(seen > seen_before, "another watcher continues meanwhile");
  if (!setting.short_form) {
    const double waited = milliseconds_since(begun);
    const auto asked = Clock::now();
    const grpc::Status status = stalled.end();
    verdict.expect(
        !status.ok() && milliseconds_since(asked) < 1000,
        "after " + std::to_string(waited / 1000) + " s the server has ended its stream: " + status.error_message());
  }
  other_context.TryCancel();
  other.join();
}

void hundred_watchers(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {"--threads", "1"});
  server.start();
  const Caller caller(server.channel());
  const std::string job = caller.submit(sweeps(caller.upload(read_case("circle_p5.msh")), 100'000));
  caller.wait_for_an_iteration(job);
  std::mutex mutex;
  std::vector<double> delays;
  std::vector<std::thread> watchers;
  std::vector<grpc::ClientContext> contexts(setting.short_form ? 20 : 100);
  for (grpc::ClientContext& context : contexts)
    watchers.emplace_back([&] {
      v1::WatchJobRequest request;
      request.set_name(job);
      request.set_after_sequence(caller.get(job).last_sequence());
      request.mutable_min_interval()->set_nanos(100'000'000);
      const auto stub = v1::JobService::NewStub(server.channel());
      const auto reader = stub->WatchJob(&context, request);
      v1::WatchJobResponse response;
      while (reader->Read(&response)) {
        const v1::JobEvent& event = response.event();
        const auto now = std::chrono::system_clock::now().time_since_epoch();
        const double sent = double(event.time().seconds()) * 1e3 + double(event.time().nanos()) * 1e-6;
        std::lock_guard lock(mutex);
        delays.push_back(std::chrono::duration<double, std::milli>(now).count() - sent);
      }
      reader->Finish();
    });
  std::this_thread::sleep_for(std::chrono::seconds(setting.short_form ? 2 : 20));
  for (grpc::ClientContext& context : contexts) context.TryCancel();
  for (std::thread& watcher : watchers) watcher.join();
  const std::size_t count = contexts.size();
  verdict.expect(delays.size() > 5 * count, std::to_string(count) + " watchers received " +
                                                std::to_string(delays.size()) + " events, p50 " +
                                                std::to_string(quantile(delays, 0.5)) + " ms");
  verdict.expect_at_most(
      quantile(delays, 0.99), 100, "ms",
      "p99 from an event to its watcher, with " + std::to_string(count) + " watchers and 10 events per second each");
}

}  // namespace

std::map<std::string, Trial> watching_trials() {
  return {{"client-killed", client_killed_in_mid_watch},
          {"stalled-watcher", watcher_that_stops_reading},
          {"hundred-watchers", hundred_watchers}};
}

}  // namespace varimesh::server::testing
