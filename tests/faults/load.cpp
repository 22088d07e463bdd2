// What the real server promises under load and in trouble, one trial a promise; kill_server, full_disk and queue_load
// have the rest.
//
//   load                    all trials; some minutes. A figure beyond its limit counts, so on a machine that is quiet
//   load --short            smaller, in seconds; figures are printed and not judged: one of the default tests
//   load --trial cancel     that one; may be repeated; --list names them
//
// Exit status: 0 all held; 1 something did not, each in a line.
#include "tests/faults/load.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <fstream>
#include <thread>

#include "core/base/sha256.h"

namespace varimesh::server::testing {
namespace {

void require(const grpc::Status& status) {
  if (status.ok()) return;
  std::printf("VIOLATION: a call failed: %s\n", status.error_message().c_str());
  std::exit(1);
}

}  // namespace

void Verdict::expect(bool held, const std::string& what) {
  std::printf("%s: %s\n", held ? "held" : "VIOLATION", what.c_str());
  violations_ += held ? 0 : 1;
}

void Verdict::expect_at_most(double figure, double limit, const std::string& unit, const std::string& what) {
  const bool held = figure <= limit;
  std::printf("%s: %s: %.4g %s, at most %.4g\n",
              held              ? "held"
              : judges_figures_ ? "VIOLATION"
                                : "BEYOND",
              what.c_str(), figure, unit.c_str(), limit);
  violations_ += held || !judges_figures_ ? 0 : 1;
}

std::string Caller::upload(const std::string& bytes) const {
  Sha256 hash;
  hash.update(bytes);
  const std::string digest = hash.finish();
  grpc::ClientContext context;
  v1::UploadMeshResponse response;
  const auto writer = meshes->UploadMesh(&context, &response);
  v1::UploadMeshRequest request;
  request.mutable_header()->set_upload_id(digest);
  request.mutable_header()->set_digest(digest);
  request.mutable_header()->set_size(static_cast<std::int64_t>(bytes.size()));
  writer->Write(request);
  for (std::size_t at = 0; at < bytes.size(); at += 256 * 1024) {
    request.mutable_chunk()->set_offset(static_cast<std::int64_t>(at));
    request.mutable_chunk()->set_data(bytes.substr(at, 256 * 1024));
    if (!writer->Write(request)) break;
  }
  writer->WritesDone();
  require(writer->Finish());
  return digest;
}

std::string Caller::submit(const v1::JobSpec& spec) const {
  v1::SubmitJobRequest request;
  *request.mutable_spec() = spec;
  grpc::ClientContext context;
  v1::SubmitJobResponse response;
  require(jobs->SubmitJob(&context, request, &response));
  return response.job().name();
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
  v1::CancelJobResponse response;
  require(jobs->CancelJob(&context, request, &response));
}

double Caller::wait_for(const std::string& name, const std::vector<v1::JobState>& states, v1::Job* job) const {
  const auto begun = Clock::now();
  while (milliseconds_since(begun) < 300'000) {
    const v1::Job now = get(name);
    if (job != nullptr) *job = now;
    if (std::find(states.begin(), states.end(), now.state()) != states.end()) return milliseconds_since(begun);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  std::printf("VIOLATION: %s does not come to the state that is waited for\n", name.c_str());
  std::exit(1);
}

std::string read_case(const std::string& name) {
  std::ifstream file(std::string(VARIMESH_SOURCE_DIR "/tests/cases/") + name, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

v1::JobSpec sweeps(const std::string& digest, int iterations, int threads) {
  v1::JobSpec spec;
  spec.mutable_mesh()->set_digest(digest);
  v1::Options& options = *spec.mutable_options();
  options.set_max_iterations(iterations);
  options.set_tolerance(1e-300);
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

int main(int argc, char** argv) {
  using namespace varimesh::server::testing;
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  Setting setting{false, VARIMESHD};
  std::vector<std::string> names;
  bool list = false;
  CLI::App app{"Holds varimeshd to what it promises under load."};
  app.add_flag("--short", setting.short_form, "Smaller, and figures are not judged");
  app.add_option("--trial", names, "This one alone; may be repeated")->allow_extra_args(false);
  app.add_flag("--list", list, "Name the trials");
  app.add_option("--server", setting.program, "The varimeshd to try")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::map<std::string, Trial> trials = watching_trials();
  trials.merge(job_trials());
  trials.merge(mesh_trials());
  Verdict verdict(!setting.short_form);
  for (const auto& [name, trial] : trials) {
    if (!names.empty() && std::find(names.begin(), names.end(), name) == names.end()) continue;
    std::printf("%s%s\n", list ? "" : "\n", name.c_str());
    if (!list) trial(setting, verdict);
  }
  return verdict.all_held() ? 0 : 1;
}
