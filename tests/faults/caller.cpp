// Calls to the real server.
#include "tests/faults/caller.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <thread>

#include "core/base/sha256.h"

namespace varimesh::server::testing {
namespace {

constexpr std::size_t kChunk = 256 * 1024;

void require(const grpc::Status& status) {
  if (status.ok()) return;
  std::printf("VIOLATION: a call failed: %s\n", status.error_message().c_str());
  std::exit(1);
}

}  // namespace

grpc::Status Caller::try_upload(const std::string& bytes, std::string* digest) const {
  *digest = sha256(bytes);
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  v1::UploadMeshResponse response;
  const auto writer = meshes->UploadMesh(&context, &response);
  v1::UploadMeshRequest request;
  request.mutable_header()->set_upload_id(*digest);
  request.mutable_header()->set_digest(*digest);
  request.mutable_header()->set_size(static_cast<std::int64_t>(bytes.size()));
  bool open = writer->Write(request);
  for (std::size_t at = 0; open && at < bytes.size(); at += kChunk) {
    request.mutable_chunk()->set_offset(static_cast<std::int64_t>(at));
    request.mutable_chunk()->set_data(bytes.substr(at, kChunk));
    open = writer->Write(request);
  }
  writer->WritesDone();
  return writer->Finish();
}

grpc::Status Caller::try_submit(const v1::JobSpec& spec, std::string* name) const {
  v1::SubmitJobRequest request;
  *request.mutable_spec() = spec;
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  v1::SubmitJobResponse response;
  const grpc::Status status = jobs->SubmitJob(&context, request, &response);
  *name = response.job().name();
  return status;
}

std::string Caller::upload(const std::string& bytes) const {
  std::string digest;
  require(try_upload(bytes, &digest));
  return digest;
}

std::string Caller::submit(const v1::JobSpec& spec) const {
  std::string name;
  require(try_submit(spec, &name));
  return name;
}

v1::Job Caller::get(const std::string& name) const {
  v1::GetJobRequest request;
  request.set_name(name);
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  v1::GetJobResponse response;
  require(jobs->GetJob(&context, request, &response));
  return response.job();
}

void Caller::cancel(const std::string& name) const {
  v1::CancelJobRequest request;
  request.set_name(name);
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  v1::CancelJobResponse response;
  require(jobs->CancelJob(&context, request, &response));
}

void Caller::remove(const std::string& name) const {
  v1::DeleteJobRequest request;
  request.set_name(name);
  grpc::ClientContext context;
  context.set_wait_for_ready(true);
  v1::DeleteJobResponse response;
  require(jobs->DeleteJob(&context, request, &response));
}

namespace {

bool has_ended(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED || state == v1::JOB_STATE_CANCELLED;
}

}  // namespace

double Caller::wait_until(const std::string& name, const std::function<bool(const v1::Job&)>& reached) const {
  const auto begun = Clock::now();
  while (milliseconds_since(begun) < 300'000) {
    const v1::Job now = get(name);
    if (reached(now)) return milliseconds_since(begun);
    if (has_ended(now.state())) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  std::printf("VIOLATION: %s does not reach the expected state; it is %s\n", name.c_str(),
              v1::JobState_Name(get(name).state()).c_str());
  std::exit(1);
}

double Caller::wait_for(const std::string& name, const std::vector<v1::JobState>& states, v1::Job* job) const {
  return wait_until(name, [&](const v1::Job& now) {
    if (job != nullptr) *job = now;
    return std::find(states.begin(), states.end(), now.state()) != states.end();
  });
}

void Caller::wait_for_an_iteration(const std::string& name) const {
  wait_until(name, [](const v1::Job& now) { return now.iteration().number() > 0; });
}

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string read_case(const std::string& name) {
  return read_file(std::string(VARIMESH_SOURCE_DIR "/tests/cases/") + name);
}

v1::JobSpec sweeps(const std::string& digest, int iterations, int threads) {
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(digest);
  v1::Options& options = *spec.mutable_options();
  options.set_max_iterations(iterations);
  options.set_tolerance(1e-15);
  options.set_active_set(false);
  options.set_method(v1::METHOD_SWEEPS);
  options.set_threads(threads);
  return spec;
}

double milliseconds_since(Clock::time_point begun) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begun).count();
}

double quantile(std::vector<double> values, double part) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(part * static_cast<double>(values.size() - 1))];
}

long memory_kib(pid_t process, const std::string& line) {
  std::ifstream status("/proc/" + std::to_string(process) + "/status");
  std::string word;
  long value = 0;
  while (status >> word)
    if (word == line + ":") status >> value;
  return value;
}

}  // namespace varimesh::server::testing
