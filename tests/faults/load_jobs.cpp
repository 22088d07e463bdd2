// Trials of jobs: cancelling, repeated requests, stopping the server, small jobs beside a large one, and the overhead
// of a server.
#include <algorithm>
#include <set>
#include <thread>

#include "client/client.h"
#include "core/formats/formats.h"
#include "core/optimise/optimiser.h"
#include "tests/faults/load.h"

namespace varimesh::server::testing {
namespace {

const std::vector<v1::JobState> kEnded{v1::JOB_STATE_SUCCEEDED, v1::JOB_STATE_FAILED, v1::JOB_STATE_CANCELLED};

void cancel(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {"--threads", "1"});
  server.start();
  const Caller caller(server.channel());
  const std::string digest = caller.upload(read_case("circle_p5.msh"));
  double queued = 0, running = 0;
  bool has_result = true;
  for (int i = 0; i < (setting.short_form ? 3 : 20); ++i) {
    const std::string first = caller.submit(sweeps(digest, 100'000)), second = caller.submit(sweeps(digest, 10));
    caller.wait_for(first, {v1::JOB_STATE_RUNNING});
    auto begun = Clock::now();
    caller.cancel(second);
    caller.wait_for(second, {v1::JOB_STATE_CANCELLED});
    queued = std::max(queued, milliseconds_since(begun));
    caller.wait_for_an_iteration(first);  // before that, the job may have no mesh yet
    begun = Clock::now();
    caller.cancel(first);
    v1::Job job;
    caller.wait_for(first, {v1::JOB_STATE_CANCELLED}, &job);
    running = std::max(running, milliseconds_since(begun));
    has_result = has_result && job.results_size() == 1 && job.metrics().iterations() > 0;
  }
  verdict.expect_at_most(queued, 200, "ms", "cancelling a waiting job");
  verdict.expect_at_most(running, 2000, "ms", "cancelling a running job");
  verdict.expect(has_result, "a job that was cancelled while it ran has the best mesh so far");
}

void repeated_request(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {"--threads", "1"});
  server.start();
  const Caller caller(server.channel());
  const std::string digest = caller.upload(read_case("nine_triangles.msh"));
  bool one_job = true, refused = true;
  for (int round = 0; round < (setting.short_form ? 5 : 100); ++round) {
    v1::SubmitJobRequest request;
    request.set_request_id("request " + std::to_string(round));
    *request.mutable_spec() = sweeps(digest, 5);
    std::vector<std::string> names(10);
    std::vector<std::thread> clients;
    for (std::string& name : names)
      clients.emplace_back([&] {
        grpc::ClientContext context;
        v1::SubmitJobResponse response;
        const auto stub = v1::JobService::NewStub(server.channel());
        if (stub->SubmitJob(&context, request, &response).ok()) name = response.job().name();
      });
    for (std::thread& client : clients) client.join();
    one_job = one_job && !names[0].empty() && std::set(names.begin(), names.end()).size() == 1;
    request.mutable_spec()->mutable_options()->set_max_iterations(6);
    grpc::ClientContext context;
    v1::SubmitJobResponse response;
    refused = refused &&
              caller.jobs->SubmitJob(&context, request, &response).error_code() == grpc::StatusCode::ALREADY_EXISTS;
  }
  verdict.expect(one_job, "ten concurrent submissions with the same request id make one job");
  verdict.expect(refused, "the same request id with another spec is refused with ALREADY_EXISTS");
}

/// Returns when the first attempt at a job was started, in milliseconds since 1970; 0 if it was not.
double last_start(const Caller& caller, const std::string& name) {
  v1::WatchJobRequest request;
  request.set_name(name);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
  const auto reader = caller.jobs->WatchJob(&context, request);
  double last = 0;
  v1::WatchJobResponse response;
  while (reader->Read(&response)) {
    const v1::JobEvent& event = response.event();
    if (event.attempt() == 1 && event.state_change().state() == v1::JOB_STATE_RUNNING)
      last = double(event.time().seconds()) * 1e3 + double(event.time().nanos()) * 1e-6;
  }
  reader->Finish();
  return last;
}

void end_of_the_server(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {"--threads", "2", "--drain-timeout", "30"});
  server.start();
  std::string digest;
  std::vector<std::string> jobs;
  {
    const Caller caller(server.channel());
    digest = caller.upload(read_case("circle_p5.msh"));
    // These jobs are short, so the server often claims a new one.
    for (int i = 0; i < (setting.short_form ? 40 : 300); ++i) jobs.push_back(caller.submit(sweeps(digest, 30)));
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  const double asked =
      std::chrono::duration<double, std::milli>(std::chrono::system_clock::now().time_since_epoch()).count();
  const auto begun = Clock::now();
  const int status = server.stop();
  const double took = milliseconds_since(begun);
  verdict.expect(status == 0, "exit status " + std::to_string(status) + " after SIGTERM with jobs running");
  verdict.expect_at_most(took, 30'000, "ms", "stopping the server");
  server.start();
  const Caller caller(server.channel());
  bool all = true;
  double latest = 0;
  for (const std::string& name : jobs) {
    v1::Job job;
    caller.wait_for(name, kEnded, &job);
    all = all && job.state() == v1::JOB_STATE_SUCCEEDED;
    const double start = last_start(caller, name);
    // The start was on the server that was stopped if it is not seconds later.
    if (start <= asked + took) latest = std::max(latest, start - asked);
  }
  verdict.expect_at_most(latest, 100, "ms", "from SIGTERM to the last claimed job");
  verdict.expect(all, "all jobs succeed after the restart");
}

void small_beside_large(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {});
  server.start();
  const Caller caller(server.channel());
  const std::string large_mesh = caller.upload(read_case("circle_p5.msh")),
                    small_mesh = caller.upload(read_case("sphere_p3.msh"));
  const auto run_small = [&] {
    const auto begun = Clock::now();
    caller.wait_for(caller.submit(sweeps(small_mesh, setting.short_form ? 50 : 400)), kEnded);
    return milliseconds_since(begun);
  };
  double alone = 0;
  for (int i = 0; i < 3; ++i) alone = std::max(alone, run_small());
  const std::string large = caller.submit(sweeps(large_mesh, 100'000, 0));
  caller.wait_for(large, {v1::JOB_STATE_RUNNING});
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const auto rate = [&](const std::function<void()>& meanwhile) {
    const int first = caller.get(large).iteration().number();
    const auto begun = Clock::now();
    meanwhile();
    return (caller.get(large).iteration().number() - first) / milliseconds_since(begun) * 1000;
  };
  const double undisturbed =
      rate([&] { std::this_thread::sleep_for(std::chrono::milliseconds(setting.short_form ? 1500 : 10'000)); });
  double slowest = 0;
  const double beside = rate([&] {
    for (int i = 0; i < 10; ++i) slowest = std::max(slowest, run_small());
  });
  const double cores = std::thread::hardware_concurrency();
  verdict.expect_at_most(slowest / alone, 2, "times its time without the large one",
                         "the slowest of ten small jobs beside a large one");
  std::printf("the large job: %.1f iterations per second alone, %.1f beside the small ones\n", undisturbed, beside);
  // The large job lends one core; a tenth is the uncertainty of the measurement.
  verdict.expect_at_most((undisturbed - beside) / undisturbed, 1 / cores + 0.1, "of its speed",
                         "what the large job loses");
}

void through_a_server(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {});
  server.start();
  const std::string path = VARIMESH_SOURCE_DIR "/tests/cases/circle_p5.msh";
  const std::string out = (server.folder() / "out.msh").string(), direct = (server.folder() / "direct.msh").string();
  std::vector<double> alone, through;
  auto client = client::Client::connect("unix:" + (server.folder() / "socket").string());
  for (int i = 0; i < (setting.short_form ? 3 : 30); ++i) {
    auto begun = Clock::now();
    auto file = formats::read_file(path);
    const auto result = optimise(std::move(file->mesh));
    if (!formats::write_file(result->mesh, file->format, direct))
      return verdict.expect(false, "the mesh can be written");
    alone.push_back(milliseconds_since(begun));
    begun = Clock::now();
    const auto mesh = client->upload_file(path);
    v1::JobSpec spec;
    spec.mutable_mesh()->set_digest(mesh->digest());
    const auto job = client->submit(spec);
    const auto ended = client->watch(job->name(), 0, [](const v1::JobEvent&) { return true; });
    if (!ended || ended->results_size() != 1 || !client->download(ended->results(0), out))
      return verdict.expect(false, "the job succeeds on a server");
    through.push_back(milliseconds_since(begun));
  }
  verdict.expect(read_file(out) == read_file(direct), "the mesh is the same bit for bit");
  std::printf("alone %.1f ms, through a server %.1f ms (medians)\n", quantile(alone, 0.5), quantile(through, 0.5));
  verdict.expect_at_most(quantile(through, 0.5) - quantile(alone, 0.5), 30, "ms", "the overhead of a server");
}

}  // namespace

std::map<std::string, Trial> job_trials() {
  return {{"cancel", cancel},
          {"request-id", repeated_request},
          {"sigterm", end_of_the_server},
          {"small-beside-large", small_beside_large},
          {"overhead", through_a_server}};
}

}  // namespace varimesh::server::testing
