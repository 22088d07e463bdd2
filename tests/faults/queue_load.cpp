// Fills the queue of the real server and measures how long it takes to submit, list and claim jobs, compared with one
// fsync on the same disk.
//
//   queue_load                10,000 jobs
//   queue_load --jobs 100000
//
// It prints figures and does not judge them.
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <thread>

#include "server/jobs/sqlite_jobs.h"
#include "tests/faults/caller.h"

namespace varimesh::server::testing {
namespace {

/// The times of many repetitions.
class Times {
 public:
  template <class Work>
  void measure(const Work& work) {
    const auto begun = Clock::now();
    work();
    all_.push_back(milliseconds_since(begun));
  }
  void add(const Times& other) { all_.insert(all_.end(), other.all_.begin(), other.all_.end()); }
  void print(const char* what) {
    if (all_.empty()) return;
    std::printf("%-34s %7zu times   p50 %7.2f ms   p99 %7.2f ms   most %7.2f ms\n", what, all_.size(),
                quantile(all_, 0.5), quantile(all_, 0.99), quantile(all_, 1));
  }

 private:
  std::vector<double> all_;
};

void measure_fsync(const std::filesystem::path& folder) {
  const int file = ::open((folder / "fsync").c_str(), O_CREAT | O_WRONLY, 0600);
  const std::string page(4096, 'x');
  Times times;
  for (int i = 0; i < 200; ++i)
    times.measure([&] {
      if (::write(file, page.data(), page.size()) < 0 || ::fsync(file) != 0) std::perror("fsync");
    });
  ::close(file);
  times.print("fsync of a page");
}

void expect_ok(const grpc::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "queue_load: %s\n", status.error_message().c_str());
  std::_Exit(1);
}

/// Measures four clients that use the server at the same time. The first job runs on the only thread and does not end,
/// so all other jobs wait.
void through_the_server(int jobs) {
  RealServer server(VARIMESHD,
                    {"--threads", "1", "--max-pending-jobs", std::to_string(2 * jobs), "--log-level", "warn"});
  server.start();
  measure_fsync(server.folder());
  const std::string digest = Caller(server.channel()).upload(read_case("circle_p5.msh"));
  const long idle = memory_kib(server.process(), "VmRSS");
  std::vector<Times> submits(4), lists(4);
  std::vector<std::thread> clients;
  for (std::size_t client = 0; client < submits.size(); ++client)
    clients.emplace_back([&, client] {
      const auto stub = v1::JobService::NewStub(server.channel());
      for (int i = 0; i < jobs / 4; ++i) {
        v1::SubmitJobRequest request;
        request.set_request_id(std::to_string(client) + "-" + std::to_string(i));
        *request.mutable_spec() = sweeps(digest, 100'000);
        (*request.mutable_spec()->mutable_labels())["client"] = std::to_string(client);
        submits[client].measure([&] {
          grpc::ClientContext context;
          v1::SubmitJobResponse response;
          expect_ok(stub->SubmitJob(&context, request, &response));
        });
        if (i % 20 != 0) continue;
        v1::ListJobsRequest list;
        (*list.mutable_labels())["client"] = "2";
        lists[client].measure([&] {
          grpc::ClientContext context;
          v1::ListJobsResponse response;
          expect_ok(stub->ListJobs(&context, list, &response));
        });
      }
    });
  for (std::thread& client : clients) client.join();
  for (std::size_t client = 1; client < submits.size(); ++client) {
    submits[0].add(submits[client]);
    lists[0].add(lists[client]);
  }
  submits[0].print("submit, by four clients");
  lists[0].print("list 100 by label, meanwhile");
  std::printf("memory: %ld MiB, %ld MiB above idle\n", memory_kib(server.process(), "VmRSS") / 1024,
              (memory_kib(server.process(), "VmRSS") - idle) / 1024);
}

/// Measures only the store, for which a worker waits.
void in_the_store(int jobs) {
  std::string folder = (std::filesystem::temp_directory_path() / "varimesh-load-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr) return std::perror(folder.c_str());
  {
    const auto store = std::move(*open_sqlite_jobs(folder + "/jobs.sqlite"));
    Times submits, claims, lists;
    Submission submission;
    submission.max_pending = 2 * jobs;
    submission.spec.mutable_mesh()->set_digest(std::string(64, 'a'));
    for (int i = 0; i < jobs; ++i) {
      submission.name = "jobs/" + std::to_string(i);
      submits.measure([&] { return store->submit(submission).has_value(); });
    }
    for (int i = 0; i < 300; ++i) claims.measure([&] { return store->claim("worker").has_value(); });
    for (int i = 0; i < 300; ++i) lists.measure([&] { return store->list({}, 100, "").has_value(); });
    submits.print("store: submit, one by one");
    claims.print("store: claim");
    lists.print("store: list 100");
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace varimesh::server::testing

int main(int argc, char** argv) {
  using namespace varimesh::server::testing;
  int jobs = 10'000;
  CLI::App app{"Measures a full queue."};
  app.add_option("--jobs", jobs, "Number of waiting jobs")->capture_default_str()->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  through_the_server(jobs);
  in_the_store(jobs);
}
