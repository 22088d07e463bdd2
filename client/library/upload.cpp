// Uploads: a mesh or a geometry goes to the server in chunks, and an upload that was cut goes on from what the server
// has stored.
#include <grpcpp/grpcpp.h>

#include <algorithm>

#include "client/client.h"
#include "client/library/authorisation.h"
#include "client/library/failures.h"
#include "client/library/input_file.h"
#include "client/library/interrupter.h"
#include "client/library/random_id.h"
#include "client/library/retry_policy.h"
#include "client/library/zstd_frame.h"
#include "core/base/sha256.h"

namespace varimesh::client {
namespace {

/// How far the bytes sent may be ahead of those that the server has acknowledged, and the size of one message. Several
/// messages make up the lead, so that one is on its way while another is stored.
constexpr std::int64_t kAheadBytes = 256 * 1024, kPieceBytes = kAheadBytes / 4;

/// The header of an upload: the size and the digest of the file, which is read once for them.
Outcome<v1::UploadHeader> header_of(const InputFile& file, const Settings& settings) {
  constexpr std::size_t kReadBytes = 256 * 1024;
  Sha256 digest;
  std::int64_t size = 0;
  std::string piece;
  while (true) {
    if (settings.wants_to_stop()) return interruption("Interrupted while the file was being read.");
    if (auto done = file.read(size, kReadBytes, piece); !done) return tl::unexpected(std::move(done.error()));
    if (piece.empty()) break;
    digest.update(piece);
    size += static_cast<std::int64_t>(piece.size());
  }
  v1::UploadHeader header;
  header.set_upload_id(random_id());
  header.set_digest(digest.finish());
  header.set_size(size);
  return header;
}

/// Puts the bytes from `offset` on into `request`, as a zstd frame if `compressed` and that is smaller.
void set_chunk(std::int64_t offset, std::string bytes, bool compressed, v1::SendMeshRequest* request) {
  std::string frame = compressed ? compress_frame(bytes) : std::string();
  request->mutable_chunk()->set_offset(offset);
  request->mutable_chunk()->set_encoding(frame.empty() ? v1::ENCODING_UNSPECIFIED : v1::ENCODING_ZSTD);
  request->mutable_chunk()->set_data(std::move(frame.empty() ? bytes : frame));
}

}  // namespace

Outcome<v1::StoredMesh> Client::upload_file(const std::string& path) {
  const auto file = InputFile::open(path, settings_.interrupted);
  if (!file) return tl::unexpected(file.error());
  return upload(*file);
}

Outcome<v1::StoredMesh> Client::upload_model(const std::string& path) {
  const auto file = InputFile::open(path, settings_.interrupted);
  if (!file) return tl::unexpected(file.error());
  return send(*file);
}

Outcome<v1::StoredMesh> Client::upload(const InputFile& file) {
  if (settings_.exchange == nullptr) return send(file);
  const auto stands_for_it = settings_.exchange->keep(file);
  if (!stands_for_it) return tl::unexpected(stands_for_it.error());
  return send(*stands_for_it);
}

Outcome<v1::StoredMesh> Client::send(const InputFile& file) {
  const auto header = header_of(file, settings_);
  if (!header) return tl::unexpected(header.error());
  RetryPolicy retries(settings_);
  std::int64_t committed = 0;
  while (true) {
    grpc::Status status;
    const auto stored = try_upload(file, *header, &committed, &retries, &status);
    if (!stored) return tl::unexpected(stored.error());
    if (stored->has_value()) return **stored;
    if (settings_.wants_to_stop()) return interruption("Interrupted while the file was being uploaded.");
    if (!retries.wait_to_retry(status)) return tl::unexpected(failure_of(status));
  }
}

Outcome<std::optional<v1::StoredMesh>> Client::try_upload(const InputFile& file, const v1::UploadHeader& header,
                                                          std::int64_t* committed, RetryPolicy* retries,
                                                          grpc::Status* status) {
  grpc::ClientContext context;
  authorise(settings_, &context);
  const Interrupter::Registration registration(interrupter_.get(), &context);
  const auto stream = meshes_->SendMesh(&context);
  v1::SendMeshRequest request;
  v1::SendMeshResponse response;
  std::optional<Failure> unreadable;
  std::int64_t sent = 0;
  bool half_closed = false;
  *request.mutable_header() = header;
  // Each answer says how many bytes the server has stored. The first answer of a repeated upload says where to go on.
  for (bool open = stream->Write(request); open && stream->Read(&response) && !response.has_mesh();) {
    // As long as bytes arrive, a connection that breaks again and again may take the full time each time.
    if (response.committed_size() > *committed) retries->server_answered();
    *committed = response.committed_size();
    sent = std::max(sent, *committed);
    while (open && !unreadable && !half_closed && sent - *committed <= kAheadBytes - kPieceBytes) {
      auto piece = file.read(sent, kPieceBytes);
      if (!piece) {
        unreadable = piece.error();
        context.TryCancel();
      } else if (piece->empty()) {
        half_closed = true;  // WritesDone() must not be called twice, even if the connection is gone.
        open = stream->WritesDone();
      } else {
        const auto size = static_cast<std::int64_t>(piece->size());
        set_chunk(sent, std::move(*piece), settings_.compress, &request);
        sent += size;
        open = stream->Write(request);
      }
    }
  }
  *status = stream->Finish();
  if (unreadable) return tl::unexpected(*unreadable);
  if (!status->ok() || !response.has_mesh()) return std::nullopt;
  retries->server_answered();
  return response.mesh();
}

}  // namespace varimesh::client
