// Optimise: upload, events and result in one call.
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

TEST(Optimise, ReturnsTheJobItsEventsAndTheMesh) {
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

TEST(Optimise, LeavesNoMeshIfItIsRefused) {
  const Service service(echo_engine());
  const auto stub = v1::OptimiseService::NewStub(service.channel);
  grpc::ClientContext context;
  const auto stream = stub->Optimise(&context);
  v1::OptimiseRequest request;
  request.mutable_spec()->mutable_spec()->set_priority(1000);
  stream->Write(request);
  request.mutable_chunk()->set_data("a mesh");
  stream->Write(request);
  stream->WritesDone();
  v1::OptimiseResponse response;
  while (stream->Read(&response)) {
  }
  EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  grpc::ClientContext asking;
  v1::QueryUploadRequest query;
  query.set_upload_id("none");
  query.set_digest(sha256("a mesh"));
  v1::QueryUploadResponse answer;
  EXPECT_EQ(service.meshes->QueryUpload(&asking, query, &answer).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST(Optimise, KeepsEachResultForItsAgeHoweverManyFollow) {
  for (const bool young : {true, false}) {
    ServerOptions options = options_with(echo_engine(1));
    options.limits.max_ended_jobs = 2;
    if (!young) options.limits.min_ended_age = std::chrono::minutes(0);
    const Service service(std::move(options));
    const v1::JobSpec spec = service.spec_for("a mesh");
    v1::Job first;
    ASSERT_TRUE(service.submit("mine", spec, &first).ok());
    service.wait_for(first.name());
    for (int i = 0; i < 10; ++i) service.wait_for(service.submit(spec).name());
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_name(first.name());
    v1::GetJobResponse response;
    EXPECT_EQ(service.jobs->GetJob(&context, request, &response).ok(), young);
    v1::Job again;
    ASSERT_TRUE(service.submit("mine", spec, &again).ok());
    EXPECT_EQ(again.name() == first.name(), young) << "its request id is remembered as long";
  }
}

}  // namespace
}  // namespace varimesh::server::testing
