// What the service promises its callers, over a real connection on loopback.
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/server/harness.h"

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

TEST(Submit, WithTheSameRequestIdAnswersWithTheSameJob) {
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

TEST(Submit, NamesTheMeshThatIsMissing) {
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

TEST(Submit, ValidateOnlyDoesNothingElse) {
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

TEST(Job, FailsWithTheSentenceOfItsInput) {
  const Service service(echo_engine());
  const v1::Job ended = service.wait_for(service.submit(service.spec_for("bad mesh")).name());
  EXPECT_EQ(ended.state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(ended.error().reason(), "BAD_INPUT");
  EXPECT_EQ(ended.error().message(), "Byte 0 is bad; send another mesh.");
}

TEST(Job, ThatNeedsMoreMemoryThanThereCanBeFailsWithASentence) {
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

TEST(Job, ThatWaitsForMemoryLendsItsThreads) {
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
      while (!lent && std::chrono::steady_clock::now() < deadline) lent = hooks.threads() == 2;
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
  EXPECT_TRUE(lent) << "both threads belong to the job that runs";
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
  EXPECT_EQ(service.cancel(job.name()).state(), v1::JOB_STATE_CANCELLED) << "cancelling twice is no error";
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

TEST(Job, IsForgottenWithItsResultWhenDeleted) {
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

TEST(Watch, DeliversEveryEventOnceAndInOrder) {
  const Service service(echo_engine(50));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  const auto events = service.watch(job.name());
  // PENDING, RUNNING, 50 iterations, two reports, SUCCEEDED
  ASSERT_EQ(events.size(), 55u);
  for (std::size_t i = 0; i < events.size(); ++i) EXPECT_EQ(events[i].sequence(), static_cast<std::int64_t>(i) + 1);
  EXPECT_EQ(events.front().state_change().state(), v1::JOB_STATE_PENDING);
  EXPECT_EQ(events.back().state_change().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(Watch, ResumesAfterACutWithoutAGap) {
  Gate gate;
  const Service service(echo_engine(60, [&](int i) {
    if (i == 30) gate.wait();
  }));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  const auto before = service.watch(job.name(), 0, 20);
  ASSERT_EQ(before.size(), 20u);
  gate.open();
  const auto after = service.watch(job.name(), before.back().sequence());
  ASSERT_FALSE(after.empty());
  std::int64_t expected = before.back().sequence();
  for (const v1::JobEvent& event : after) {
    EXPECT_EQ(event.sequence(), ++expected);
    EXPECT_EQ(event.thinned(), 0);
  }
  EXPECT_EQ(after.back().state_change().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(Watch, RefusesANumberThatWasNeverGiven) {
  const Service service(echo_engine());
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  service.wait_for(job.name());
  grpc::Status status;
  EXPECT_TRUE(service.watch(job.name(), 1000, 10, &status).empty());
  EXPECT_EQ(status.error_code(), grpc::StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(info_of(status).reason(), "SEQUENCE_EXPIRED");
  google::rpc::Status full;
  ASSERT_TRUE(full.ParseFromString(status.error_details()));
  v1::Job current;
  bool found = false;
  for (const auto& detail : full.details()) found = found || detail.UnpackTo(&current);
  EXPECT_TRUE(found);
  EXPECT_EQ(current.name(), job.name());
}

TEST(Watch, SendsABookmarkWhenNothingHappens) {
  Gate gate;
  ServerOptions options = options_with(echo_engine(1, [&](int) { gate.wait(); }));
  options.limits.bookmark_interval = std::chrono::milliseconds(50);
  const Service service(std::move(options));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  const auto events = service.watch(job.name(), 0, 3);
  gate.open();
  ASSERT_EQ(events.size(), 3u);
  EXPECT_TRUE(events[2].has_bookmark());
  EXPECT_EQ(events[2].sequence(), events[1].sequence());
}

TEST(Result, HoldsTheWholeHistoryAndTheMesh) {
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

TEST(OneCall, BringsTheJobItsEventsAndTheMesh) {
  const Service service(echo_engine(4));
  const auto stub = v1::OptimiseService::NewStub(service.channel);
  const std::string mesh(600'000, 'q');
  grpc::ClientContext context;
  const auto stream = stub->Optimise(&context);
  v1::OptimiseRequest request;
  request.mutable_spec()->set_size(static_cast<std::int64_t>(mesh.size()));
  ASSERT_TRUE(stream->Write(request));
  for (std::size_t at = 0; at < mesh.size(); at += 200'000) {
    request.mutable_chunk()->set_offset(static_cast<std::int64_t>(at));
    request.mutable_chunk()->set_data(mesh.substr(at, 200'000));
    ASSERT_TRUE(stream->Write(request));
  }
  stream->WritesDone();
  v1::OptimiseResponse response;
  std::string name, bytes;
  std::int64_t sequence = 0;
  int iterations = 0;
  while (stream->Read(&response)) {
    if (response.has_accepted()) name = response.accepted().name();
    if (response.has_event()) {
      EXPECT_EQ(response.event().sequence(), ++sequence);
    }
    iterations += response.history().iterations_size();
    if (response.has_chunk()) bytes += response.chunk().chunk().data();
  }
  const grpc::Status status = stream->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(service.get(name).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(iterations, 4);
  EXPECT_EQ(bytes, mesh);
}

TEST(Server, GivesTenClientsAtOnceWhatALoneOneGets) {
  const Service service(echo_engine(20));
  const std::string mesh(300'000, 'z');
  std::vector<std::thread> clients;
  std::vector<std::string> results(10);
  for (std::size_t i = 0; i < results.size(); ++i)
    clients.emplace_back([&, i] {
      // A mesh of its own each, on a connection of its own.
      const std::string mine = mesh + std::to_string(i);
      Service own_view = Service(options_with(echo_engine(20)));
      const v1::Job ended = own_view.wait_for(own_view.submit(own_view.spec_for(mine)).name());
      const v1::Job shared = service.wait_for(service.submit(service.spec_for(mine)).name());
      ASSERT_EQ(shared.state(), v1::JOB_STATE_SUCCEEDED);
      EXPECT_EQ(shared.results(0).digest(), ended.results(0).digest());
      results[i] = service.download(shared.results(0).digest());
      EXPECT_EQ(results[i], mine);
    });
  for (std::thread& client : clients) client.join();
}

TEST(Server, StopsWithLiveWatchersAndUploads) {
  Gate gate;
  Service service(echo_engine(1000, [&](int i) {
    if (i == 2) gate.wait();
  }));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  std::vector<std::thread> watchers;
  std::vector<grpc::Status> ends(8);
  std::atomic<int> open = 0;
  for (grpc::Status& end : ends)
    watchers.emplace_back([&] {
      grpc::ClientContext context;
      v1::WatchJobRequest request;
      request.set_name(job.name());
      const auto reader = service.jobs->WatchJob(&context, request);
      v1::WatchJobResponse response;
      reader->Read(&response);
      ++open;
      while (reader->Read(&response)) {
      }
      end = reader->Finish();
    });
  // An upload whose client says nothing more.
  grpc::ClientContext stalled;
  v1::UploadMeshResponse response;
  const auto writer = service.meshes->UploadMesh(&stalled, &response);
  v1::UploadMeshRequest header;
  header.mutable_header()->set_upload_id("stalled");
  header.mutable_header()->set_digest(std::string(64, 'c'));
  header.mutable_header()->set_size(10);
  ASSERT_TRUE(writer->Write(header));
  while (open < 8) std::this_thread::yield();
  std::thread later([&] { gate.open(); });
  EXPECT_TRUE(service.server->stop(std::chrono::seconds(20)));
  later.join();
  for (std::thread& watcher : watchers) watcher.join();
  for (const grpc::Status& end : ends) EXPECT_EQ(end.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(writer->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
}

TEST(Server, RefusesAnAddressBeyondLoopbackUnlessToldAloud) {
  for (const char* address : {"0.0.0.0:0", "[::]:0", "192.0.2.1:0", "example.org:0"}) {
    const auto started = Server::start(options_with(echo_engine(), address));
    ASSERT_FALSE(started) << address;
    EXPECT_EQ(started.error().kind, Error::Kind::BadOption);
    EXPECT_NE(started.error().sentence.find("--insecure"), std::string::npos);
  }
}

TEST(Server, RefusesAPortThatIsTaken) {
  const Service first(echo_engine());
  const auto second = Server::start(options_with(echo_engine(), first.server->address()));
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().kind, Error::Kind::Output);
}

TEST(Server, SaysThatItServesAndServesInProcess) {
  const Service service(echo_engine());
  for (const auto& channel : {service.channel, service.server->in_process_channel()}) {
    grpc::ClientContext context;
    grpc::health::v1::HealthCheckResponse response;
    const auto health = grpc::health::v1::Health::NewStub(channel);
    ASSERT_TRUE(health->Check(&context, grpc::health::v1::HealthCheckRequest(), &response).ok());
    EXPECT_EQ(response.status(), grpc::health::v1::HealthCheckResponse::SERVING);
  }
}

TEST(Server, ListsJobsInPagesByStateAndLabel) {
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

TEST(Server, RefusesListsThatNoJobCanBeIn) {
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
  for (int i = 0; i < 100'000; ++i) request.add_states(v1::JOB_STATE_PENDING);
  for (int i = 0; i < 32; ++i) (*request.mutable_labels())[std::to_string(i)] = "value";
  EXPECT_TRUE(list(request).ok());
  (*request.mutable_labels())["one more"] = "value";
  EXPECT_EQ(info_of(list(request)).reason(), "BAD_REQUEST");
}

}  // namespace
}  // namespace varimesh::server::testing
