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

}  // namespace
}  // namespace varimesh::server::testing
