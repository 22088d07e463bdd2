// Submitting, cancelling, deleting and listing jobs, and results, over a connection on loopback.
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

TEST(Submit, RunsAJobAndKeepsItsResult) {
  const Service service(echo_engine(5));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  const v1::Job ended = service.wait_for(job.name());
  ASSERT_EQ(ended.state(), v1::JOB_STATE_SUCCEEDED) << ended.error().message();
  EXPECT_EQ(ended.metrics().iterations(), 5);
  ASSERT_EQ(ended.results_size(), 1);
  EXPECT_EQ(service.download(ended.results(0).digest()), "a mesh");
  EXPECT_EQ(service.download(ended.results(0).digest(), 2), "mesh");
}

TEST(Submit, ReturnsTheSameJobForTheSameRequestId) {
  const Service service(echo_engine());
  const v1::JobSpec spec = service.spec_for("a mesh");
  v1::Job first, second, third;
  ASSERT_TRUE(service.submit("id", spec, &first).ok());
  ASSERT_TRUE(service.submit("id", spec, &second).ok());
  EXPECT_EQ(first.name(), second.name());

  v1::JobSpec other = spec;
  other.mutable_options()->set_max_iterations(7);
  const grpc::Status status = service.submit("id", other, &third);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::ALREADY_EXISTS);
  EXPECT_EQ(info_of(status).reason(), "REQUEST_ID_USED");
  EXPECT_EQ(info_of(status).domain(), "varimesh");
}

TEST(Submit, NamesTheMissingMesh) {
  const Service service(echo_engine());
  v1::JobSpec spec;
  const std::string digest(64, 'a');
  spec.mutable_mesh()->set_digest(digest);
  v1::Job job;
  const grpc::Status status = service.submit("", spec, &job);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(info_of(status).reason(), "MESH_NOT_FOUND");
  EXPECT_EQ(info_of(status).metadata().at("digest"), digest);
}

TEST(Submit, ChecksButDoesNotQueueWithValidateOnly) {
  const Service service(echo_engine());
  v1::JobSpec spec = service.spec_for("a mesh");
  v1::Job job;
  EXPECT_TRUE(service.submit("id", spec, &job, true).ok());
  EXPECT_TRUE(job.name().empty());
  spec.mutable_options()->set_tolerance(-1);
  const grpc::Status status = service.submit("id", spec, &job, true);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(info_of(status).reason(), "BAD_OPTION");
  grpc::ClientContext context;
  v1::ListJobsResponse all;
  ASSERT_TRUE(service.jobs->ListJobs(&context, v1::ListJobsRequest(), &all).ok());
  EXPECT_EQ(all.jobs_size(), 0);
}

TEST(Submit, RefusesMoreWorkThanTheServerAllows) {
  ServerOptions options = options_with(echo_engine());
  options.limits.max_job_iterations = 50;
  options.limits.max_job_seconds = 60;
  options.limits.max_priority = 3;
  const Service service(std::move(options));
  const v1::JobSpec good = service.spec_for("a mesh");
  v1::Job job;
  v1::JobSpec spec = good;
  spec.mutable_options()->set_max_iterations(51);
  EXPECT_NE(service.submit("", spec, &job).error_message().find("--max-job-iterations"), std::string::npos);
  spec.mutable_options()->set_max_iterations(50);
  spec.mutable_options()->set_time_limit(61);
  EXPECT_NE(service.submit("", spec, &job).error_message().find("60 seconds"), std::string::npos);
  spec = good;
  spec.set_priority(4);
  EXPECT_NE(service.submit("", spec, &job).error_message().find("from -100 to 3"), std::string::npos);
  spec.set_priority(3);
  spec.mutable_options()->set_max_iterations(50);
  spec.mutable_options()->set_time_limit(60);
  EXPECT_TRUE(service.submit("", spec, &job).ok());
}

TEST(Job, HasTheServersTimeLimitIfItHasNone) {
  std::vector<double> limits;
  Engine engine = echo_engine();
  engine.run = [&, echo = engine.run](RunRequest request, const RunHooks& hooks) {
    limits.push_back(request.options.time_limit);
    return echo(std::move(request), hooks);
  };
  ServerOptions options = options_with(engine);
  options.limits.max_job_seconds = 60;
  const Service service(std::move(options));
  v1::JobSpec spec = service.spec_for("a mesh");
  service.wait_for(service.submit(spec).name());
  spec.mutable_options()->set_time_limit(5);
  service.wait_for(service.submit(spec).name());
  EXPECT_EQ(limits, (std::vector<double>{60, 5}));
}

TEST(Job, FailsWithTheEnginesSentenceAboutABadMesh) {
  const Service service(echo_engine());
  const v1::Job ended = service.wait_for(service.submit(service.spec_for("bad mesh")).name());
  EXPECT_EQ(ended.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(ended.error().reason(), "BAD_INPUT");
  EXPECT_EQ(ended.error().message(), "Byte 0 is bad; send another mesh.");
}

TEST(Job, FailsIfItNeedsMoreMemoryThanTheLimit) {
  Engine engine = echo_engine();
  engine.run = [echo = engine.run](RunRequest request, const RunHooks& hooks) -> Expected<RunOutcome> {
    const std::int64_t megabytes = request.input->bytes() == "large" ? 300 : 100;
    if (const auto admitted = hooks.admit(megabytes << 20); !admitted) return tl::unexpected(admitted.error());
    return echo(std::move(request), hooks);
  };
  ServerOptions options = options_with(engine);
  options.limits.max_memory_bytes = std::int64_t{200} << 20;
  const Service service(std::move(options));
  EXPECT_EQ(service.wait_for(service.submit(service.spec_for("small")).name()).state(), v1::JOB_STATE_SUCCEEDED);
  const v1::Job large = service.wait_for(service.submit(service.spec_for("large")).name());
  EXPECT_EQ(large.state(), v1::JOB_STATE_FAILED);
  EXPECT_NE(large.error().message().find("--max-memory-bytes"), std::string::npos);
}

TEST(Job, LendsItsThreadsWhileItWaitsForMemory) {
  std::atomic<bool> lent = false;
  Gate waits;
  Engine engine = echo_engine();
  engine.run = [&, echo = engine.run](RunRequest request, const RunHooks& hooks) -> Expected<RunOutcome> {
    const bool first = request.input->bytes() == "first";
    if (!first) waits.open();
    if (const auto admitted = hooks.admit(150 << 20); !admitted) return tl::unexpected(admitted.error());
    if (first) {
      waits.wait();
      const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
      while (!lent && std::chrono::steady_clock::now() < deadline) lent = hooks.control.threads() == 2;
    }
    return echo(std::move(request), hooks);
  };
  ServerOptions options = options_with(engine);
  options.limits.max_memory_bytes = std::int64_t{200} << 20;
  const Service service(std::move(options));
  const v1::Job first = service.submit(service.spec_for("first"));
  const v1::Job second = service.submit(service.spec_for("second"));
  EXPECT_EQ(service.wait_for(first.name()).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(service.wait_for(second.name()).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_TRUE(lent) << "the running job has both threads";
}

TEST(Job, IsCancelledWhileItRuns) {
  Gate started, cancelled;
  const Service service(echo_engine(1000, [&](int i) {
    if (i != 2) return;
    started.open();
    cancelled.wait();
  }));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  started.wait();
  EXPECT_EQ(service.cancel(job.name()).state(), v1::JOB_STATE_CANCELLING);
  cancelled.open();
  EXPECT_EQ(service.wait_for(job.name()).state(), v1::JOB_STATE_CANCELLED);
  EXPECT_EQ(service.cancel(job.name()).state(), v1::JOB_STATE_CANCELLED) << "cancelling twice is not an error";
}

TEST(Job, IsCancelledWhileItWaits) {
  Gate gate;
  ServerOptions options = options_with(echo_engine(1, [&](int) { gate.wait(); }));
  options.limits.threads = 1;
  const Service service(std::move(options));
  const v1::JobSpec spec = service.spec_for("a mesh");
  const v1::Job running = service.submit(spec), waiting = service.submit(spec);
  EXPECT_EQ(service.cancel(waiting.name()).state(), v1::JOB_STATE_CANCELLED);
  gate.open();
  EXPECT_EQ(service.wait_for(running.name()).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(Job, IsNotFoundAfterItWasDeleted) {
  const Service service(echo_engine(1, [](int) {}));
  v1::JobSpec spec = service.spec_for("a mesh");
  const v1::Job ended = service.wait_for(service.submit(spec).name());
  for (const auto expected : {grpc::StatusCode::OK, grpc::StatusCode::NOT_FOUND}) {
    grpc::ClientContext context;
    v1::DeleteJobRequest request;
    request.set_name(ended.name());
    v1::DeleteJobResponse response;
    EXPECT_EQ(service.jobs->DeleteJob(&context, request, &response).error_code(), expected);
  }
}

TEST(Result, HasTheWholeHistoryAndTheMesh) {
  const Service service(echo_engine(2500));
  const std::string mesh(700'000, 'm');
  const v1::Job ended = service.wait_for(service.submit(service.spec_for(mesh)).name());
  grpc::ClientContext context;
  v1::GetResultRequest request;
  request.set_name(ended.name());
  const auto reader = service.jobs->GetResult(&context, request);
  v1::GetResultResponse response;
  int next = 1;
  std::string bytes;
  while (reader->Read(&response)) {
    for (const auto& iteration : response.history().iterations()) EXPECT_EQ(iteration.number(), next++);
    if (response.has_chunk()) bytes += response.chunk().chunk().data();
  }
  EXPECT_TRUE(reader->Finish().ok());
  EXPECT_EQ(next, 2501);
  EXPECT_EQ(bytes, mesh);
}

TEST(List, ReturnsPagesFilteredByStateAndLabel) {
  const Service service(echo_engine(1));
  v1::JobSpec spec = service.spec_for("a mesh");
  for (int i = 0; i < 5; ++i) {
    (*spec.mutable_labels())["colour"] = i % 2 == 0 ? "red" : "blue";
    service.wait_for(service.submit(spec).name());
  }
  v1::ListJobsRequest request;
  request.set_page_size(2);
  (*request.mutable_labels())["colour"] = "red";
  request.add_states(v1::JOB_STATE_SUCCEEDED);
  std::vector<int> pages;
  do {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    ASSERT_TRUE(service.jobs->ListJobs(&context, request, &response).ok());
    pages.push_back(response.jobs_size());
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_EQ(pages, (std::vector<int>{2, 1}));
}

TEST(List, RefusesUnknownStatesAndTooManyLabels) {
  const Service service(echo_engine(1));
  const auto list = [&](const v1::ListJobsRequest& request) {
    grpc::ClientContext context;
    v1::ListJobsResponse response;
    return service.jobs->ListJobs(&context, request, &response);
  };
  for (const int state : {0, 99}) {
    v1::ListJobsRequest request;
    request.add_states(static_cast<v1::JobState>(state));
    EXPECT_EQ(info_of(list(request)).reason(), "BAD_REQUEST") << state;
  }
  v1::ListJobsRequest request;
  for (int i = 0; i < 60'000; ++i) request.add_states(v1::JOB_STATE_PENDING);
  for (int i = 0; i < 32; ++i) (*request.mutable_labels())[std::to_string(i)] = "value";
  EXPECT_TRUE(list(request).ok());
  (*request.mutable_labels())["one more"] = "value";
  EXPECT_EQ(info_of(list(request)).reason(), "BAD_REQUEST");
  request.clear_labels();
  for (int i = 0; i < 10'000; ++i) request.add_states(v1::JOB_STATE_PENDING);
  EXPECT_EQ(info_of(list(request)).reason(), "BAD_REQUEST") << "more than 64 KiB";
}

}  // namespace
}  // namespace varimesh::server::testing
