// Trials of transfers: uploads that are cut, a large mesh, and the speed of uploads.
#include <algorithm>
#include <cstdint>
#include <fstream>

#include "client/client.h"
#include "core/base/sha256.h"
#include "tests/faults/cutting_proxy.h"
#include "tests/faults/load.h"

namespace varimesh::server::testing {
namespace {

constexpr std::size_t kChunk = 256 * 1024;

/// Returns part of an endless sequence of pseudo-random bytes, which stand for a mesh.
std::string piece(std::int64_t at, std::size_t size) {
  std::string bytes(size, 0);
  for (std::size_t i = 0; i < size; i += 8) {
    std::uint64_t word = (static_cast<std::uint64_t>(at) + i) * 0x9e3779b97f4a7c15;
    word ^= word >> 29;
    std::copy_n(reinterpret_cast<const char*>(&word), std::min<std::size_t>(8, size - i), &bytes[i]);
  }
  return bytes;
}

v1::UploadMeshRequest header(const std::string& id, std::int64_t size) {
  Sha256 hash;
  for (std::int64_t at = 0; at < size; at += kChunk)
    hash.update(piece(at, static_cast<std::size_t>(std::min<std::int64_t>(kChunk, size - at))));
  v1::UploadMeshRequest request;
  request.mutable_header()->set_upload_id(id);
  request.mutable_header()->set_digest(hash.finish());
  request.mutable_header()->set_size(size);
  return request;
}

std::int64_t committed(const Caller& caller, const v1::UploadMeshRequest& head) {
  v1::QueryUploadRequest query;
  query.set_upload_id(head.header().upload_id());
  grpc::ClientContext context;
  v1::QueryUploadResponse known;
  return caller.meshes->QueryUpload(&context, query, &known).ok() ? known.committed_size() : 0;
}

/// Sends at most `most` bytes of a mesh from `from` on. Cuts the stream if the mesh is not complete then. Returns how
/// many bytes of the mesh have been sent.
std::int64_t send(const Caller& caller, const v1::UploadMeshRequest& head, std::int64_t from, std::int64_t most,
                  grpc::Status* status) {
  grpc::ClientContext context;
  v1::UploadMeshResponse response;
  const auto writer = caller.meshes->UploadMesh(&context, &response);
  bool open = writer->Write(head);
  const std::int64_t end = std::min(head.header().size(), from + most);
  std::int64_t at = from;
  v1::UploadMeshRequest request;
  while (open && at < end) {
    request.mutable_chunk()->set_offset(at);
    request.mutable_chunk()->set_data(piece(at, static_cast<std::size_t>(std::min<std::int64_t>(kChunk, end - at))));
    open = writer->Write(request);
    if (open) at += static_cast<std::int64_t>(request.chunk().data().size());
  }
  if (end < head.header().size())
    context.TryCancel();
  else
    writer->WritesDone();
  *status = writer->Finish();
  return at;
}

/// Writes a file with bytes that no other file has.
std::string write_mesh(const RealServer& server, std::int64_t size) {
  static std::int64_t beginning = 0;
  const std::string path = (server.folder() / "mesh").string();
  std::ofstream file(path, std::ios::binary);
  for (std::int64_t at = 0; at < size; at += kChunk)
    file << piece(beginning + at, static_cast<std::size_t>(std::min<std::int64_t>(kChunk, size - at)));
  beginning += size;
  return path;
}

void cut_upload(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {"--max-mesh-bytes", "100000000"});
  server.start();
  const Caller caller(server.channel());
  const CuttingProxy proxy(server.folder() / "proxy", server.folder() / "socket", 3'000'000);
  auto client = client::Client::connect("unix:" + (server.folder() / "proxy").string());
  bool whole = client.has_value();
  for (int round = 0; whole && round < (setting.short_form ? 3 : 10); ++round)
    whole = client->upload_file(write_mesh(server, 10'000'000)).has_value();
  verdict.expect(whole && proxy.cuts() > 0,
                 "the client completes its uploads over " + std::to_string(proxy.cuts()) + " cut connections");
  // One hundredth for the framing of HTTP/2.
  verdict.expect(static_cast<std::size_t>(proxy.most_held()) <= kChunk * 101 / 100,
                 "sent again after a cut: at most " + std::to_string(proxy.most_held()) + " bytes, one chunk");
  const grpc::Status too_large = [&] {
    v1::UploadMeshRequest head = header("large", 8);
    head.mutable_header()->set_size(100'000'001);
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = caller.meshes->UploadMesh(&context, &response);
    writer->Write(head);
    return writer->Finish();
  }();
  verdict.expect(
      too_large.error_code() == grpc::StatusCode::RESOURCE_EXHAUSTED && reason_of(too_large) == "MESH_TOO_LARGE",
      "a mesh that is too large is refused at its header");
}

void upload_speed(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {});
  server.start();
  const Caller caller(server.channel());
  auto client = client::Client::connect("unix:" + (server.folder() / "socket").string());
  std::vector<double> ahead, acknowledged;
  bool whole = true;
  const std::int64_t size = setting.short_form ? 5'000'000 : 50'000'000;
  for (int i = 0; i < (setting.short_form ? 3 : 20); ++i) {
    const std::string bytes = read_file(write_mesh(server, size));
    auto begun = Clock::now();
    caller.upload(bytes);
    ahead.push_back(milliseconds_since(begun));
    const std::string path = write_mesh(server, size);
    read_file(path);  // so that both uploads read from the file cache
    begun = Clock::now();
    whole = whole && client->upload_file(path).has_value();
    acknowledged.push_back(milliseconds_since(begun));
  }
  verdict.expect(whole, "meshes are uploaded");
  std::printf("%.0f MB: %.1f ms by UploadMesh, %.1f ms by the client (medians); least %.1f and %.1f\n",
              double(size) / 1e6, quantile(ahead, 0.5), quantile(acknowledged, 0.5), quantile(ahead, 0),
              quantile(acknowledged, 0));
}

void large_mesh(const Setting& setting, Verdict& verdict) {
  RealServer server(setting.program, {});
  server.start();
  const Caller caller(server.channel());
  const std::int64_t size = setting.short_form ? std::int64_t{64} << 20 : std::int64_t{2} << 30;
  const v1::UploadMeshRequest head = header("large", size);
  // The memory that a first, small transfer needs does not belong to the mesh.
  grpc::Status status;
  send(caller, header("small", 1 << 20), 0, size, &status);
  const long idle = memory_kib(server.process(), "VmRSS");
  long most = idle;
  for (std::int64_t at = 0; at < size;) {
    // In parts, to measure the server in between.
    at = send(caller, head, committed(caller, head), std::int64_t{32} << 20, &status);
    most = std::max(most, memory_kib(server.process(), "VmRSS"));
  }
  verdict.expect(status.ok(), "a mesh of " + std::to_string(size >> 20) + " MiB is uploaded");
  verdict.expect_at_most(double(most - idle) / 1024, 64, "MiB", "additional memory during the upload");
  v1::DownloadMeshRequest request;
  request.set_digest(head.header().digest());
  grpc::ClientContext context;
  const auto reader = caller.meshes->DownloadMesh(&context, request);
  v1::DownloadMeshResponse response;
  std::int64_t came = 0;
  most = 0;
  while (reader->Read(&response)) {
    came += static_cast<std::int64_t>(response.chunk().data().size());
    if ((came >> 18) % 16 == 0) most = std::max(most, memory_kib(server.process(), "VmRSS"));
  }
  verdict.expect(reader->Finish().ok() && came == size, "it is downloaded again");
  verdict.expect_at_most(double(most - idle) / 1024, 64, "MiB", "additional memory during the download");
}

}  // namespace

std::map<std::string, Trial> mesh_trials() {
  return {{"cut-upload", cut_upload}, {"large-mesh", large_mesh}, {"upload-speed", upload_speed}};
}

}  // namespace varimesh::server::testing
