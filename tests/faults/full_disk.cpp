// Fills the disk of the real server (a small tmpfs) under running jobs, and holds it to what must be true then: it
// takes nothing more and says so, it is not ready, what runs goes on, nothing is lost, and it is itself again when
// there is room.
//
//   full_disk         half a minute; needs the right to mount a tmpfs
//
// Exit status: 0 all held; 1 some did not, each in a line; 77 not run, with the reason.
#include <sys/mount.h>

#include <cstdio>
#include <fstream>
#include <functional>
#include <thread>

#include "core/base/sha256.h"
#include "server/jobs/sqlite.h"
#include "tests/faults/real_server.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server::testing {
namespace {

constexpr std::int64_t kDisk = 32 << 20, kReserve = 8 << 20;
int violations = 0;

void expect(bool held, const std::string& what) {
  std::printf("%s: %s\n", held ? "held" : "VIOLATION", what.c_str());
  violations += held ? 0 : 1;
}

/// Whether something becomes true within minutes: a job of a second takes its time under a sanitizer, on a busy
/// machine.
bool soon(const std::function<bool()>& condition) {
  for (int i = 0; i < 6000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return condition();
}

/// A tmpfs that goes with it.
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

  /// Leaves no more than so many bytes.
  void fill(std::int64_t leave) const {
    std::ofstream file(path_ / "filler", std::ios::binary | std::ios::app);
    const std::string block(4096, 'x');
    while (file && free() > leave) file.write(block.data(), static_cast<std::streamsize>(block.size())).flush();
  }
  void empty() const { std::filesystem::remove(path_ / "filler"); }

 private:
  std::int64_t free() const { return static_cast<std::int64_t>(std::filesystem::space(path_).available); }

  std::filesystem::path path_;
  bool mounted_ = false;
};

class Client {
 public:
  explicit Client(const RealServer& server)
      : jobs_(v1::JobService::NewStub(server.channel())), meshes_(v1::MeshService::NewStub(server.channel())) {}

  grpc::Status upload(const std::string& bytes, std::string* digest) const {
    Sha256 hash;
    hash.update(bytes);
    *digest = hash.finish();
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    v1::UploadMeshResponse response;
    const auto writer = meshes_->UploadMesh(&context, &response);
    v1::UploadMeshRequest request;
    request.mutable_header()->set_upload_id(*digest);
    request.mutable_header()->set_digest(*digest);
    request.mutable_header()->set_size(static_cast<std::int64_t>(bytes.size()));
    writer->Write(request);
    request.mutable_chunk()->set_data(bytes);
    writer->Write(request);
    writer->WritesDone();
    return writer->Finish();
  }
  grpc::Status submit(const std::string& digest, int iterations, std::string* name) const {
    v1::SubmitJobRequest request;
    request.mutable_spec()->mutable_mesh()->set_digest(digest);
    v1::Options& options = *request.mutable_spec()->mutable_options();
    options.set_max_iterations(iterations);
    options.set_tolerance(1e-300);
    options.set_active_set(false);
    options.set_method(v1::METHOD_SWEEPS);
    options.set_threads(1);
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    v1::SubmitJobResponse response;
    const grpc::Status status = jobs_->SubmitJob(&context, request, &response);
    *name = response.job().name();
    return status;
  }
  v1::Job get(const std::string& name) const {
    v1::GetJobRequest request;
    request.set_name(name);
    grpc::ClientContext context;
    context.set_wait_for_ready(true);
    v1::GetJobResponse response;
    const grpc::Status status = jobs_->GetJob(&context, request, &response);
    if (!status.ok()) expect(false, name + " is known: " + status.error_message());
    return response.job();
  }
  grpc::Status cancel(const std::string& name) const {
    v1::CancelJobRequest request;
    request.set_name(name);
    grpc::ClientContext context;
    v1::CancelJobResponse response;
    return jobs_->CancelJob(&context, request, &response);
  }

 private:
  std::unique_ptr<v1::JobService::Stub> jobs_;
  std::unique_ptr<v1::MeshService::Stub> meshes_;
};

int run() {
  const SmallDisk disk;
  if (!disk.mounted()) {
    std::printf("SKIPPED: full_disk: a small tmpfs cannot be mounted here; run it as root\n");
    return 77;
  }
  RealServer server(VARIMESHD, {"--threads", "2", "--reserve-bytes", std::to_string(kReserve)}, disk.state());
  server.start();
  const Client client(server);
  std::ifstream file(VARIMESH_SOURCE_DIR "/tests/cases/circle_p5.msh", std::ios::binary);
  const std::string mesh(std::istreambuf_iterator<char>(file), {});
  std::string digest, other, longest, shorter, waiting, refused;
  expect(client.upload(mesh, &digest).ok(), "a mesh is taken while there is room");
  client.submit(digest, 1'000'000, &longest);
  client.submit(digest, 300, &shorter);
  client.submit(digest, 10, &waiting);
  expect(soon([&] { return client.get(longest).state() == v1::JOB_STATE_RUNNING; }), "a job runs");

  disk.fill(kReserve / 2);
  expect(soon([&] { return !server.serves(); }), "not ready when less than the reserve is left");
  const grpc::Status submitted = client.submit(digest, 10, &refused), uploaded = client.upload(mesh + "\n", &other);
  expect(reason_of(submitted) == "STORE_FULL", "a job is refused with STORE_FULL: " + submitted.error_message());
  expect(reason_of(uploaded) == "STORE_FULL", "a mesh is refused with STORE_FULL: " + uploaded.error_message());
  expect(soon([&] { return client.get(shorter).state() == v1::JOB_STATE_SUCCEEDED; }),
         "a job that ends has its result stored in the reserve");
  expect(soon([&] { return client.get(waiting).state() == v1::JOB_STATE_SUCCEEDED; }),
         "a job that was taken before is run");

  disk.fill(0);
  const auto last = client.get(longest).last_sequence();
  expect(soon([&] { return client.get(longest).last_sequence() > last; }), "with no byte left the job still goes on");

  disk.empty();
  expect(soon([&] { return server.serves(); }), "ready again when there is room");
  expect(client.upload(mesh + "\n", &other).ok(), "a mesh is taken again");
  expect(client.submit(digest, 10, &refused).ok(), "a job is taken again");
  client.cancel(longest);
  expect(soon([&] { return client.get(longest).state() == v1::JOB_STATE_CANCELLED; }), "the long job can be cancelled");
  expect(soon([&] { return client.get(refused).state() == v1::JOB_STATE_SUCCEEDED; }), "the new job is done");

  server.kill();
  server.start();
  for (const std::string& name : {longest, shorter, waiting, refused}) client.get(name);
  expect(server.stop() == 0, "it stops as it should");
  SqliteDatabase database((disk.state() / "jobs.sqlite").string());
  auto check = database.query("PRAGMA integrity_check");
  expect(check.step() && check.text(0) == "ok", "the database is intact");
  return violations == 0 ? 0 : 1;
}

}  // namespace
}  // namespace varimesh::server::testing

int main() { return varimesh::server::testing::run(); }
