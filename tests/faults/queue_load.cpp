// Fills the real server's queue and measures what it costs to submit, list and claim beside it, against one fsync of
// the same disk.
//
//   queue_load                10,000 jobs
//   queue_load --jobs 100000
//
// It prints figures and judges none.
#include <fcntl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <thread>

#include "core/base/sha256.h"
#include "server/jobs/sqlite_job_store.h"
#include "tests/faults/real_server.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server::testing {
namespace {

using std::chrono::steady_clock;

/// Times of many runs of one thing.
class Times {
 public:
  template <class Work>
  void measure(const Work& work) {
    const auto begun = steady_clock::now();
    work();
    all_.push_back(std::chrono::duration<double, std::milli>(steady_clock::now() - begun).count());
  }
  void add(const Times& other) { all_.insert(all_.end(), other.all_.begin(), other.all_.end()); }
  void print(const char* what) {
    if (all_.empty()) return;
    std::sort(all_.begin(), all_.end());
    const auto at = [&](double part) { return all_[static_cast<std::size_t>(part * (all_.size() - 1))]; };
    std::printf("%-34s %7zu times   p50 %7.2f ms   p99 %7.2f ms   most %7.2f ms\n", what, all_.size(), at(0.5),
                at(0.99), all_.back());
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

long resident_kib(pid_t process) {
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  std::string word;
  long value = 0;
  while (status >> word)
    if (word == "VmRSS:") status >> value;
  return value;
}

void expect_ok(const grpc::Status& status) {
  if (status.ok()) return;
  std::fprintf(stderr, "queue_load: %s\n", status.error_message().c_str());
  std::_Exit(1);
}

std::string upload(const RealServer& server) {
  std::ifstream file(VARIMESH_SOURCE_DIR "/tests/cases/circle_p5.msh", std::ios::binary);
  const std::string mesh(std::istreambuf_iterator<char>(file), {});
  Sha256 hash;
  hash.update(mesh);
  v1::UploadMeshRequest request;
  request.mutable_header()->set_upload_id("mesh");
  request.mutable_header()->set_digest(hash.finish());
  request.mutable_header()->set_size(static_cast<std::int64_t>(mesh.size()));
  const std::string digest = request.header().digest();
  grpc::ClientContext context;
  v1::UploadMeshResponse response;
  const auto writer = v1::MeshService::NewStub(server.channel())->UploadMesh(&context, &response);
  writer->Write(request);
  request.mutable_chunk()->set_data(mesh);
  writer->Write(request);
  writer->WritesDone();
  expect_ok(writer->Finish());
  return digest;
}

/// A job that goes on for ever on the only thread, so that the others wait.
v1::JobSpec endless(const std::string& digest) {
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(digest);
  spec.mutable_options()->set_max_iterations(1'000'000'000);
  spec.mutable_options()->set_tolerance(1e-300);
  spec.mutable_options()->set_active_set(false);
  spec.mutable_options()->set_method(v1::METHOD_SWEEPS);
  return spec;
}

/// Over the wire, by four clients at once.
void through_the_server(int jobs) {
  RealServer server(VARIMESHD,
                    {"--threads", "1", "--max-pending-jobs", std::to_string(2 * jobs), "--log-level", "warn"});
  server.start();
  measure_fsync(server.folder());
  const std::string digest = upload(server);
  const long idle = resident_kib(server.process());
  std::vector<Times> submits(4), lists(4);
  std::vector<std::thread> clients;
  for (std::size_t client = 0; client < submits.size(); ++client)
    clients.emplace_back([&, client] {
      const auto stub = v1::JobService::NewStub(server.channel());
      for (int i = 0; i < jobs / 4; ++i) {
        v1::SubmitJobRequest request;
        request.set_request_id(std::to_string(client) + "-" + std::to_string(i));
        *request.mutable_spec() = endless(digest);
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
  submits[0].print("submit, four clients at once");
  lists[0].print("list 100 of a label meanwhile");
  std::printf("memory: %ld MiB, %ld MiB above idle\n", resident_kib(server.process()) / 1024,
              (resident_kib(server.process()) - idle) / 1024);
}

/// In the store alone, which is what a worker waits for.
void in_the_store(int jobs) {
  std::string folder = (std::filesystem::temp_directory_path() / "varimesh-load-XXXXXX").string();
  if (::mkdtemp(folder.data()) == nullptr) return std::perror(folder.c_str());
  {
    const auto store = std::move(*SqliteJobStore::open(folder + "/jobs.sqlite"));
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
    submits.print("store: submit, one after another");
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
  app.add_option("--jobs", jobs, "That wait")->capture_default_str()->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  through_the_server(jobs);
  in_the_store(jobs);
}
