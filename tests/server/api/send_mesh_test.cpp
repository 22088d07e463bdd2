// SendMesh: uploads that are acknowledged chunk by chunk. DownloadMesh with compression.
#include "server/meshes/zstd.h"
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

v1::SendMeshRequest header_of(const std::string& bytes) {
  v1::SendMeshRequest request;
  request.mutable_header()->set_upload_id("upload");
  request.mutable_header()->set_digest(sha256(bytes));
  request.mutable_header()->set_size(static_cast<std::int64_t>(bytes.size()));
  return request;
}

v1::SendMeshRequest chunk_of(std::int64_t offset, const std::string& bytes) {
  v1::SendMeshRequest request;
  request.mutable_chunk()->set_offset(offset);
  request.mutable_chunk()->set_data(bytes);
  return request;
}

TEST(SendMesh, AcknowledgesEveryChunkAndThenTheMesh) {
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
  EXPECT_EQ(response.mesh().size(), 12) << "a mesh in the store is acknowledged at once";
  EXPECT_TRUE(stream->Finish().ok());
}

TEST(SendMesh, ContinuesAfterACut) {
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

TEST(SendMesh, RefusesBytesWithAnotherDigest) {
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

TEST(SendMesh, RefusesAChunkOutOfOrder) {
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

/// Text that compresses well.
std::string long_text(int lines) {
  std::string text;
  for (int i = 0; i < lines; ++i) text += std::to_string(i) + " 0.123456 " + std::to_string(i % 7) + "\n";
  return text;
}

TEST(SendMesh, AcceptsCompressedChunks) {
  const Service service(echo_engine());
  const std::string bytes = long_text(10'000);
  const std::string frame = zstd_compress(bytes);
  ASSERT_LT(frame.size(), bytes.size());
  grpc::ClientContext context;
  const auto stream = service.meshes->SendMesh(&context);
  v1::SendMeshResponse response;
  ASSERT_TRUE(stream->Write(header_of(bytes)) && stream->Read(&response));
  v1::SendMeshRequest chunk = chunk_of(0, frame);
  chunk.mutable_chunk()->set_encoding(v1::ENCODING_ZSTD);
  ASSERT_TRUE(stream->Write(chunk) && stream->Read(&response));
  EXPECT_EQ(response.committed_size(), static_cast<std::int64_t>(bytes.size()));
  stream->WritesDone();
  ASSERT_TRUE(stream->Read(&response));
  EXPECT_TRUE(stream->Finish().ok());
  EXPECT_EQ(service.download(response.mesh().digest()), bytes);
}

TEST(SendMesh, RefusesInvalidFrames) {
  const Service service(echo_engine());
  const std::string bytes = long_text(200'000);  // more than the largest chunk
  const std::string frame = zstd_compress(bytes);
  ASSERT_FALSE(frame.empty());
  for (const std::string& wrong : {std::string("no frame"), frame, zstd_compress(long_text(100)).substr(0, 50)}) {
    grpc::ClientContext context;
    const auto stream = service.meshes->SendMesh(&context);
    stream->Write(header_of(bytes));
    v1::SendMeshRequest chunk = chunk_of(0, wrong);
    chunk.mutable_chunk()->set_encoding(v1::ENCODING_ZSTD);
    stream->Write(chunk);
    v1::SendMeshResponse response;
    while (stream->Read(&response)) EXPECT_EQ(response.committed_size(), 0);
    const grpc::Status status = stream->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << wrong.size();
    EXPECT_EQ(info_of(status).reason(), "BAD_REQUEST");
  }
}

TEST(DownloadMesh, CompressesChunksOnRequestIfThatMakesThemSmaller) {
  const Service service(echo_engine());
  const std::string text = long_text(40'000);
  std::string noise(300'000, '\0');
  std::uint32_t state = 1;
  for (char& c : noise) c = static_cast<char>((state = state * 1664525 + 1013904223) >> 24);
  for (const std::string& bytes : {text, noise}) {
    v1::DownloadMeshRequest request;
    request.set_digest(service.upload(bytes, 100'000));
    request.set_encoding(v1::ENCODING_ZSTD);
    request.set_offset(1000);
    grpc::ClientContext context;
    const auto reader = service.meshes->DownloadMesh(&context, request);
    v1::DownloadMeshResponse response;
    std::string came, content;
    std::size_t travelled = 0;
    while (reader->Read(&response)) {
      EXPECT_EQ(response.chunk().offset(), static_cast<std::int64_t>(1000 + came.size()));
      travelled += response.chunk().data().size();
      if (response.chunk().encoding() == v1::ENCODING_ZSTD) {
        ASSERT_TRUE(zstd_decompress(response.chunk().data(), 1 << 20, &content));
        came += content;
      } else {
        came += response.chunk().data();
      }
    }
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_EQ(came, bytes.substr(1000));
    if (bytes == text)
      EXPECT_LT(travelled, bytes.size() / 2);
    else
      EXPECT_EQ(travelled, bytes.size() - 1000);
  }
}

}  // namespace
}  // namespace varimesh::server::testing
