// UploadMesh: uploads with one answer at the end.
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

TEST(UploadMesh, ContinuesAfterACut) {
  const Service service(echo_engine());
  const std::string bytes(3000, 'x');
  v1::UploadMeshRequest header;
  header.mutable_header()->set_upload_id("mine");
  header.mutable_header()->set_digest(sha256(bytes));
  header.mutable_header()->set_size(3000);
  {
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = service.meshes->UploadMesh(&context, &response);
    writer->Write(header);
    v1::UploadMeshRequest chunk;
    chunk.mutable_chunk()->set_data(bytes.substr(0, 1000));
    writer->Write(chunk);
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << "the stream ended too early";
    EXPECT_EQ(info_of(status).metadata().at("committed_size"), "1000");
  }
  grpc::ClientContext query_context;
  v1::QueryUploadRequest query;
  query.set_upload_id("mine");
  v1::QueryUploadResponse known;
  ASSERT_TRUE(service.meshes->QueryUpload(&query_context, query, &known).ok());
  EXPECT_EQ(known.committed_size(), 1000);
  EXPECT_FALSE(known.complete());

  grpc::ClientContext context;
  v1::UploadMeshResponse response;
  const auto writer = service.meshes->UploadMesh(&context, &response);
  writer->Write(header);
  v1::UploadMeshRequest chunk;
  chunk.mutable_chunk()->set_offset(1000);
  chunk.mutable_chunk()->set_data(bytes.substr(1000));
  writer->Write(chunk);
  writer->WritesDone();
  ASSERT_TRUE(writer->Finish().ok());
  EXPECT_EQ(service.download(header.header().digest()), bytes);
}

/// Declares `size` bytes with some digest under the id "mine", sends `bytes`, and returns the status of the call.
grpc::Status upload(const Service& service, std::int64_t size, const std::string& bytes) {
  v1::UploadMeshRequest message;
  message.mutable_header()->set_upload_id("mine");
  message.mutable_header()->set_digest(std::string(64, 'b'));
  message.mutable_header()->set_size(size);
  grpc::ClientContext context;
  v1::UploadMeshResponse response;
  const auto writer = service.meshes->UploadMesh(&context, &response);
  writer->Write(message);
  if (!bytes.empty()) {
    message.mutable_chunk()->set_data(bytes);
    writer->Write(message);
    writer->WritesDone();
  }
  return writer->Finish();
}

TEST(UploadMesh, RefusesBytesWithAnotherDigest) {
  const Service service(echo_engine());
  const grpc::Status status = upload(service, 3, "abc");
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(info_of(status).reason(), "DIGEST_MISMATCH");
}

TEST(UploadMesh, RefusesMoreBytesThanDeclaredAndKeepsNothing) {
  const Service service(echo_engine());
  const grpc::Status status = upload(service, 3, "abcd");
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(info_of(status).reason(), "MESH_LARGER_THAN_SAID");
  grpc::ClientContext again;
  v1::QueryUploadRequest query;
  query.set_upload_id("mine");
  v1::QueryUploadResponse known;
  EXPECT_EQ(service.meshes->QueryUpload(&again, query, &known).error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST(UploadMesh, RefusesATooLargeMeshAtItsHeader) {
  ServerOptions options = options_with(echo_engine());
  options.limits.max_mesh_bytes = 100;
  const Service service(std::move(options));
  EXPECT_EQ(info_of(upload(service, 101, "")).reason(), "MESH_TOO_LARGE");
}

TEST(UploadMesh, RefusesAMeshThatTakesMoreMemoryThanAllJobsHave) {
  ServerOptions options = options_with(echo_engine());
  options.limits.max_memory_bytes = 1000;
  const Service service(std::move(options));
  const grpc::Status status = upload(service, 5005, "");
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(info_of(status).reason(), "MESH_TOO_LARGE");
  EXPECT_NE(status.error_message().find("1001 bytes of memory"), std::string::npos) << status.error_message();
  EXPECT_NE(info_of(upload(service, 5000, "x")).reason(), "MESH_TOO_LARGE");
}

TEST(DeleteMesh, DeletesWhatNoJobRefersTo) {
  const Service service(echo_engine());
  const auto remove = [&](const std::string& digest) {
    grpc::ClientContext context;
    v1::DeleteMeshRequest request;
    request.set_digest(digest);
    v1::DeleteMeshResponse response;
    return service.meshes->DeleteMesh(&context, request, &response);
  };
  const v1::Job job = service.wait_for(service.submit(service.spec_for("a mesh")).name());
  const grpc::Status used = remove(job.spec().mesh().digest());
  EXPECT_EQ(used.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(info_of(used).reason(), "MESH_IN_USE");
  const std::string other = service.upload("another mesh");
  EXPECT_TRUE(remove(other).ok());
  EXPECT_EQ(remove(other).error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(service.upload("another mesh"), other) << "it is taken again";
}

}  // namespace
}  // namespace varimesh::server::testing
