// The limits per address, over a connection on loopback.
#include "grpc/health/v1/health.grpc.pb.h"
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

/// Checks that the status has the reason, the address and a retry time.
void expect_peer_limit(const grpc::Status& status) {
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
  EXPECT_EQ(info_of(status).reason(), "PEER_LIMIT");
  EXPECT_EQ(info_of(status).metadata().at("peer"), "127.0.0.1");
  EXPECT_NE(status.error_message().find("127.0.0.1"), std::string::npos) << status.error_message();
  google::rpc::Status full;
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(full.ParseFromString(status.error_details()));
  bool says_when = false;
  for (const auto& detail : full.details()) says_when = says_when || detail.UnpackTo(&retry);
  EXPECT_TRUE(says_when);
  EXPECT_GT(retry.retry_delay().seconds(), 0);
}

TEST(PeerLimit, OfWatches) {
  Gate gate;
  ServerOptions options = options_with(echo_engine(1, [&](int) { gate.wait(); }));
  options.limits.max_watches_per_peer = 2;
  const Service service(std::move(options));
  v1::WatchJobRequest request;
  request.set_name(service.submit(service.spec_for("a mesh")).name());
  v1::WatchJobResponse response;
  {
    grpc::ClientContext contexts[3];
    const auto first = service.jobs->WatchJob(&contexts[0], request),
               second = service.jobs->WatchJob(&contexts[1], request);
    ASSERT_TRUE(first->Read(&response));
    ASSERT_TRUE(second->Read(&response));
    const auto third = service.jobs->WatchJob(&contexts[2], request);
    EXPECT_FALSE(third->Read(&response));
    expect_peer_limit(third->Finish());
    for (grpc::ClientContext& context : contexts) context.TryCancel();
    first->Finish();
    second->Finish();
  }
  gate.open();
  // The server learns of the cancels after a while.
  grpc::Status status(grpc::StatusCode::UNKNOWN, "");
  for (int i = 0; i < 1000 && !status.ok(); ++i) {
    service.watch(request.name(), 0, 1000, &status);
    if (!status.ok()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST(PeerLimit, OfWatchesOfTheHealth) {
  ServerOptions options = options_with(echo_engine());
  options.limits.max_watches_per_peer = 2;
  const Service service(std::move(options));
  const auto stub = grpc::health::v1::Health::NewStub(service.channel);
  grpc::health::v1::HealthCheckResponse response;
  grpc::ClientContext contexts[3];
  const auto first = stub->Watch(&contexts[0], {}), second = stub->Watch(&contexts[1], {});
  ASSERT_TRUE(first->Read(&response));
  ASSERT_TRUE(second->Read(&response));
  const auto third = stub->Watch(&contexts[2], {});
  EXPECT_FALSE(third->Read(&response));
  expect_peer_limit(third->Finish());
  grpc::ClientContext checking;
  EXPECT_TRUE(stub->Check(&checking, {}, &response).ok()) << "a check is no watch";
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  EXPECT_EQ(service.wait_for(job.name()).state(), v1::JOB_STATE_SUCCEEDED) << "watches of jobs count for themselves";
  for (grpc::ClientContext& context : contexts) context.TryCancel();
  first->Finish();
  second->Finish();
  // The server learns of the cancels after a while.
  bool begins = false;
  for (int i = 0; i < 1000 && !begins; ++i) {
    grpc::ClientContext context;
    const auto again = stub->Watch(&context, {});
    begins = again->Read(&response);
    context.TryCancel();
    again->Finish();
    if (!begins) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(begins);
}

TEST(PeerLimit, OfUploads) {
  ServerOptions options = options_with(echo_engine());
  options.limits.max_uploads_per_peer = 1;
  const Service service(std::move(options));
  v1::SendMeshRequest header;
  header.mutable_header()->set_upload_id("id");
  header.mutable_header()->set_digest(std::string(64, 'a'));
  header.mutable_header()->set_size(10);
  grpc::ClientContext contexts[2], client_stream, one_call;
  const auto first = service.meshes->SendMesh(&contexts[0]);
  ASSERT_TRUE(first->Write(header));
  v1::SendMeshResponse response;
  ASSERT_TRUE(first->Read(&response));

  const auto second = service.meshes->SendMesh(&contexts[1]);
  second->Write(header);
  EXPECT_FALSE(second->Read(&response));
  expect_peer_limit(second->Finish());
  v1::UploadMeshResponse uploaded;
  expect_peer_limit(service.meshes->UploadMesh(&client_stream, &uploaded)->Finish());
  const auto stub = v1::OptimiseService::NewStub(service.channel);
  expect_peer_limit(stub->Optimise(&one_call)->Finish());
  contexts[0].TryCancel();
  first->Finish();
}

TEST(PeerLimit, OfWaitingJobs) {
  Gate gate;
  ServerOptions options = options_with(echo_engine(1, [&](int) { gate.wait(); }));
  options.limits.threads = 1;
  options.limits.max_pending_jobs_per_peer = 1;
  const Service service(std::move(options));
  const v1::JobSpec spec = service.spec_for("a mesh");
  service.submit(spec);
  service.submit(spec);
  v1::Job job;
  expect_peer_limit(service.submit("", spec, &job));
  gate.open();
}

TEST(PeerLimit, OfRunningJobsMakesOtherJobsWait) {
  Gate gate;
  std::atomic<int> running = 0, most = 0;
  ServerOptions options = options_with(echo_engine(1, [&](int) {
    most = std::max(most.load(), ++running);
    gate.wait();
    --running;
  }));
  options.limits.max_running_jobs_per_peer = 1;
  const Service service(std::move(options));
  const v1::JobSpec spec = service.spec_for("a mesh");
  const std::string first = service.submit(spec).name(), second = service.submit(spec).name();
  EXPECT_EQ(service.get(second).state(), v1::JOB_STATE_PENDING);
  gate.open();
  EXPECT_EQ(service.wait_for(first).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(service.wait_for(second).state(), v1::JOB_STATE_SUCCEEDED);
  EXPECT_EQ(most, 1);
}

TEST(PeerLimit, OfDownloads) {
  ServerOptions options = options_with(echo_engine());
  options.limits.max_downloads_per_peer = 1;
  const Service service(std::move(options));
  const std::string mesh(64 << 20, 'x');  // more than what is on its way while nobody reads
  const v1::Job job = service.wait_for(service.submit(service.spec_for("a mesh")).name());
  v1::DownloadMeshRequest large, small;
  large.set_digest(service.upload(mesh, 1 << 18));
  small.set_digest(sha256("a mesh"));
  v1::GetResultRequest result;
  result.set_name(job.name());
  v1::DownloadMeshResponse piece;
  v1::GetResultResponse part;
  grpc::ClientContext contexts[3];
  const auto first = service.meshes->DownloadMesh(&contexts[0], large);
  ASSERT_TRUE(first->Read(&piece));
  const auto second = service.meshes->DownloadMesh(&contexts[1], small);
  EXPECT_FALSE(second->Read(&piece));
  expect_peer_limit(second->Finish());
  const auto third = service.jobs->GetResult(&contexts[2], result);
  EXPECT_FALSE(third->Read(&part));
  expect_peer_limit(third->Finish());
  std::size_t got = piece.chunk().data().size();
  while (first->Read(&piece)) got += piece.chunk().data().size();
  EXPECT_TRUE(first->Finish().ok());
  EXPECT_EQ(got, mesh.size());
  // The place is free once the server has noticed the end.
  grpc::Status status(grpc::StatusCode::UNKNOWN, "");
  for (int i = 0; i < 1000 && !status.ok(); ++i) {
    grpc::ClientContext context;
    const auto reader = service.jobs->GetResult(&context, result);
    while (reader->Read(&part)) continue;
    status = reader->Finish();
    if (!status.ok()) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(status.ok()) << status.error_message();
}

}  // namespace
}  // namespace varimesh::server::testing
