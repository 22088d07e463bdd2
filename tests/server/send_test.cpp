// Uploads that are acknowledged as they come.
#include "tests/server/harness.h"

namespace varimesh::server::testing {
namespace {

v1::SendMeshRequest header_of(const std::string& bytes) {
  Sha256 hash;
  hash.update(bytes);
  v1::SendMeshRequest request;
  request.mutable_header()->set_upload_id("upload");
  request.mutable_header()->set_digest(hash.finish());
  request.mutable_header()->set_size(static_cast<std::int64_t>(bytes.size()));
  return request;
}

v1::SendMeshRequest chunk_of(std::int64_t offset, const std::string& bytes) {
  v1::SendMeshRequest request;
  request.mutable_chunk()->set_offset(offset);
  request.mutable_chunk()->set_data(bytes);
  return request;
}

TEST(SendMesh, SaysHowFarItCameAndThenTheMesh) {
  const Service service(echo_engine());
  const v1::SendMeshRequest header = header_of("a whole mesh");
  v1::SendMeshResponse response;
  {
    grpc::ClientContext context;
    const auto stream = service.meshes->SendMesh(&context);
    ASSERT_TRUE(stream->Write(header));
    ASSERT_TRUE(stream->Read(&response));
    EXPECT_EQ(response.committed_size(), 0);
    ASSERT_TRUE(stream->Write(chunk_of(0, "a whole ")));
    ASSERT_TRUE(stream->Read(&response));
    EXPECT_EQ(response.committed_size(), 8);
    ASSERT_TRUE(stream->Write(chunk_of(8, "mesh")));
    ASSERT_TRUE(stream->Read(&response));
    EXPECT_EQ(response.committed_size(), 12);
    stream->WritesDone();
    ASSERT_TRUE(stream->Read(&response));
    EXPECT_EQ(response.mesh().digest(), header.header().digest());
    EXPECT_EQ(response.mesh().size(), 12);
    EXPECT_FALSE(stream->Read(&response));
    EXPECT_TRUE(stream->Finish().ok());
  }
  EXPECT_EQ(service.download(header.header().digest()), "a whole mesh");
  grpc::ClientContext again;
  const auto stream = service.meshes->SendMesh(&again);
  ASSERT_TRUE(stream->Write(header));
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.mesh().size(), 12) << "what is there is answered at once";
  EXPECT_TRUE(stream->Finish().ok());
}

TEST(SendMesh, GoesOnWhereItBroke) {
  const Service service(echo_engine());
  const v1::SendMeshRequest header = header_of("a whole mesh");
  v1::SendMeshResponse response;
  {
    grpc::ClientContext context;
    const auto stream = service.meshes->SendMesh(&context);
    ASSERT_TRUE(stream->Write(header) && stream->Read(&response));
    ASSERT_TRUE(stream->Write(chunk_of(0, "a wh")) && stream->Read(&response));
    context.TryCancel();
    stream->Finish();
  }
  grpc::ClientContext context;
  const auto stream = service.meshes->SendMesh(&context);
  ASSERT_TRUE(stream->Write(header) && stream->Read(&response));
  EXPECT_EQ(response.committed_size(), 4);
  ASSERT_TRUE(stream->Write(chunk_of(4, "ole mesh")) && stream->Read(&response) && stream->WritesDone());
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_EQ(response.mesh().size(), 12);
  EXPECT_TRUE(stream->Finish().ok());
}

TEST(SendMesh, RefusesBytesThatAreNotTheDigests) {
  const Service service(echo_engine());
  grpc::ClientContext context;
  const auto stream = service.meshes->SendMesh(&context);
  stream->Write(header_of("a whole mesh"));
  stream->Write(chunk_of(0, "another mesh"));
  stream->WritesDone();
  v1::SendMeshResponse response;
  while (stream->Read(&response)) EXPECT_FALSE(response.has_mesh());
  const grpc::Status status = stream->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(info_of(status).reason(), "DIGEST_MISMATCH");
}

TEST(SendMesh, RefusesAChunkThatDoesNotFollow) {
  const Service service(echo_engine());
  grpc::ClientContext context;
  const auto stream = service.meshes->SendMesh(&context);
  stream->Write(header_of("a whole mesh"));
  stream->Write(chunk_of(3, "hole"));
  v1::SendMeshResponse response;
  while (stream->Read(&response)) EXPECT_EQ(response.committed_size(), 0);
  const grpc::Status status = stream->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::OUT_OF_RANGE);
  EXPECT_EQ(info_of(status).metadata().at("committed_size"), "0");
}

}  // namespace
}  // namespace varimesh::server::testing
