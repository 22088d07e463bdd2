// Downloads: the mesh goes to a temporary file, which takes its final name once the digest is right.
#include <grpcpp/grpcpp.h>

#include "client/client.h"
#include "client/library/authorisation.h"
#include "client/library/failures.h"
#include "client/library/input_file.h"
#include "client/library/interrupter.h"
#include "client/library/retry_policy.h"
#include "client/library/zstd_frame.h"
#include "core/base/io/output_file.h"
#include "core/base/sha256.h"

namespace varimesh::client {
namespace {

constexpr std::size_t kMostChunkBytes = 1024 * 1024;

/// Reads the stream from request.offset() to its end, or until the file cannot be written. `offset` moves on with the
/// bytes. Returns false if a chunk is damaged.
bool read_chunks(grpc::ClientReader<v1::DownloadMeshResponse>& stream, OutputFile& file, Sha256& digest,
                 v1::DownloadMeshRequest* request, RetryPolicy* retries) {
  v1::DownloadMeshResponse response;
  std::string content;
  while (!file.failed() && stream.Read(&response)) {
    const bool is_frame = response.chunk().encoding() == v1::ENCODING_ZSTD;
    if (is_frame && !expand_frame(response.chunk().data(), kMostChunkBytes, &content)) return false;
    const std::string& bytes = is_frame ? content : response.chunk().data();
    file.write(bytes);
    digest.update(bytes);
    request->set_offset(request->offset() + static_cast<std::int64_t>(bytes.size()));
    retries->server_answered();
  }
  return true;
}

/// Writes the bytes of an open file to another file.
Outcome<void> copy(const InputFile& from, const std::string& path, const Settings& settings) {
  if (from.has_changed())
    return file_failure(
        "The input file has changed since the job read it, so it cannot be shown beside the result; write results to "
        "other files.");
  auto file = OutputFile::open(path);
  if (!file) return file_failure(file.error().sentence);
  std::string piece;
  for (std::int64_t offset = 0;;) {
    if (settings.wants_to_stop()) return interruption("Interrupted while the result was being written.");
    if (auto done = from.read(offset, kMostChunkBytes, piece); !done) return done;
    if (piece.empty() || !file->write(piece)) break;
    offset += static_cast<std::int64_t>(piece.size());
  }
  if (const auto done = file->commit(); !done) return file_failure(done.error().sentence);
  return {};
}

}  // namespace

Outcome<void> Client::download(const v1::StoredMesh& mesh, const std::string& path) {
  if (settings_.exchange != nullptr)
    if (const auto kept = settings_.exchange->find(mesh.digest()); kept != nullptr) return copy(*kept, path, settings_);
  auto file = OutputFile::open(path);
  if (!file) return file_failure(file.error().sentence);
  Sha256 digest;
  v1::DownloadMeshRequest request;
  request.set_digest(mesh.digest());
  if (settings_.compress) request.set_encoding(v1::ENCODING_ZSTD);
  RetryPolicy retries(settings_);
  while (true) {
    grpc::ClientContext context;
    authorise(settings_, &context);
    const Interrupter::Registration registration(interrupter_.get(), &context);
    const auto stream = meshes_->DownloadMesh(&context, request);
    const bool damaged = !read_chunks(*stream, *file, digest, &request, &retries);
    if (file->failed() || damaged) context.TryCancel();
    const grpc::Status status = stream->Finish();
    if (file->failed() || damaged || status.ok()) break;  // The digest shows whether all bytes are there.
    if (retries.wait_to_retry(status)) continue;
    if (settings_.wants_to_stop()) return interruption("Interrupted while the result was being fetched.");
    return tl::unexpected(failure_of(status));
  }
  if (!file->failed() && digest.finish() != mesh.digest())
    return transport_failure("The result arrived damaged; fetch it again.", "DIGEST_MISMATCH");
  if (const auto done = file->commit(); !done) return file_failure(done.error().sentence);
  return {};
}

}  // namespace varimesh::client
