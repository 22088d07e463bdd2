// Fills the disk of the real server (a small tmpfs) while jobs run, and checks what must hold then: the server refuses
// meshes and jobs with the reason, it is not ready, running jobs continue, nothing is lost, and the server recovers
// when there is room again.
//
//   full_disk                 a minute; needs the permission to mount a tmpfs
//   full_disk --seconds 100   the disk stays full for longer than a run may take after its time limit
//
// Exit status: 0: everything held; 1: something did not, with a line for each; 77: not run, with the reason.
#include <sys/mount.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <functional>
#include <thread>

#include "server/jobs/sqlite.h"
#include "tests/faults/caller.h"

namespace varimesh::server::testing {
namespace {

constexpr std::int64_t kDisk = 32 << 20, kReserve = 8 << 20;
int violations = 0;

void expect(bool held, const std::string& what) {
  std::printf("%s: %s\n", held ? "held" : "VIOLATION", what.c_str());
  violations += held ? 0 : 1;
}

/// Waits until a condition is true, for up to five minutes, since a sanitizer and a busy machine make jobs slow.
bool soon(const std::function<bool()>& condition) {
  for (int i = 0; i < 6000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return condition();
}

/// A tmpfs that is unmounted when this object is destroyed.
class SmallDisk {
 public:
  SmallDisk() {
    std::string name = (std::filesystem::temp_directory_path() / "varimesh-disk-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
    mounted_ = ::mount("none", path_.c_str(), "tmpfs", 0, ("size=" + std::to_string(kDisk)).c_str()) == 0;
  }
  ~SmallDisk() {
    if (mounted_) ::umount2(path_.c_str(), MNT_DETACH);
    std::filesystem::remove_all(path_);
  }
  bool mounted() const { return mounted_; }
  std::filesystem::path state() const { return path_ / "state"; }

  /// Fills the disk until at most `leave` bytes are free.
  void fill(std::int64_t leave) const {
    std::ofstream file(path_ / "filler", std::ios::binary | std::ios::app);
    const std::string page(4096, 'x');
    while (file && free() > leave) file.write(page.data(), static_cast<std::streamsize>(page.size())).flush();
  }
  void empty() const { std::filesystem::remove(path_ / "filler"); }

 private:
  std::int64_t free() const { return static_cast<std::int64_t>(std::filesystem::space(path_).available); }

  std::filesystem::path path_;
  bool mounted_ = false;
};

void check_database(const SmallDisk& disk) {
  SqliteDatabase database((disk.state() / "jobs.sqlite").string());
  auto check = database.query("PRAGMA integrity_check");
  expect(check.step() && check.text(0) == "ok", "the database is intact");
}

void check_refusals(const Caller& client, const std::string& digest, const std::string& mesh) {
  std::string refused, other;
  const grpc::Status submitted = client.try_submit(sweeps(digest, 10), &refused),
                     uploaded = client.try_upload(mesh + "\n", &other);
  expect(reason_of(submitted) == "STORE_FULL", "a job is refused with STORE_FULL: " + submitted.error_message());
  expect(reason_of(uploaded) == "STORE_FULL", "a mesh is refused with STORE_FULL: " + uploaded.error_message());
}

int run(int seconds) {
  const SmallDisk disk;
  if (!disk.mounted()) {
    std::printf("SKIPPED: full_disk: a small tmpfs cannot be mounted here; run it as root\n");
    return 77;
  }
  RealServer server(VARIMESHD, {"--threads", "3", "--reserve-bytes", std::to_string(kReserve)}, disk.state());
  server.start();
  const Caller client(server.channel());
  const std::string mesh = read_case("circle_p5.msh");
  std::string digest, other, longest, shorter, waiting, late, refused;
  expect(client.try_upload(mesh, &digest).ok(), "a mesh is accepted while there is room");
  client.try_submit(sweeps(digest, 100'000), &longest);
  client.try_submit(sweeps(digest, 300), &shorter);
  client.try_submit(sweeps(digest, 10), &waiting);
  v1::JobSpec limited = sweeps(digest, 100'000);
  constexpr int kLimit = 20;
  limited.mutable_options()->set_time_limit(kLimit);
  client.try_submit(limited, &late);
  const auto submitted_late = Clock::now();
  expect(soon([&] { return client.get(longest).state() == v1::JOB_STATE_RUNNING; }), "a job runs");

  disk.fill(kReserve / 2);
  expect(soon([&] { return !server.serves(); }), "the server is not ready if less than the reserve is free");
  check_refusals(client, digest, mesh);
  expect(soon([&] { return client.get(shorter).state() == v1::JOB_STATE_SUCCEEDED; }),
         "the result of a running job is stored in the reserve");
  expect(soon([&] { return client.get(waiting).state() == v1::JOB_STATE_SUCCEEDED; }),
         "a job that was accepted before is run");

  disk.fill(0);
  const auto last = client.get(longest).last_sequence();
  expect(soon([&] { return client.get(longest).last_sequence() > last; }),
         "with no byte free a running job still continues");
  expect(client.get(late).state() == v1::JOB_STATE_RUNNING, "the disk is full before the time limit of a job");
  std::this_thread::sleep_until(submitted_late + std::chrono::seconds(kLimit + seconds));
  expect(client.get(late).state() == v1::JOB_STATE_RUNNING, "at its end, this job waits for room for its result");
  client.cancel(longest);
  expect(soon([&] { return client.get(longest).state() == v1::JOB_STATE_CANCELLED; }),
         "with no byte free a job can be cancelled");
  client.remove(waiting);

  disk.empty();
  expect(soon([&] { return server.serves(); }), "the server is ready again when there is room");
  expect(client.try_upload(mesh + "\n", &other).ok(), "a mesh is accepted again");
  expect(client.try_submit(sweeps(digest, 10), &refused).ok(), "a job is accepted again");
  expect(soon([&] { return client.get(late).state() == v1::JOB_STATE_SUCCEEDED; }), "the job that waited succeeds");
  expect(client.get(late).results_size() == 1, "and has its result");
  expect(soon([&] { return client.get(refused).state() == v1::JOB_STATE_SUCCEEDED; }), "the new job succeeds");

  server.kill();
  server.start();
  for (const std::string& name : {longest, shorter, late, refused}) client.get(name);
  expect(server.stop() == 0, "the server stops with exit status 0");
  check_database(disk);
  return violations == 0 ? 0 : 1;
}

}  // namespace
}  // namespace varimesh::server::testing

int main(int argc, char** argv) {
  int seconds = 3;
  CLI::App app{"Fills the disk of varimeshd while jobs run."};
  app.add_option("--seconds", seconds, "How long a job waits for room")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  return varimesh::server::testing::run(seconds);
}
