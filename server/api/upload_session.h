// An upload, message by message. UploadMesh and SendMesh share it.
#pragma once

#include <grpcpp/support/status.h>

#include <optional>

#include "server/addresses.h"
#include "server/api/context.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::server {

/// Handles the messages of one stream. One thread at a time.
class UploadSession {
 public:
  UploadSession(const ApiContext& api, const std::string& peer)
      : meshes_(api.meshes),
        address_(peer_address(peer)),
        most_(api.uploads.most()),
        place_(api.uploads.take(address_)) {}

  /// Returns an error if the caller's address already has as many open uploads as it may have. An upload whose stream
  /// was cut, and which the store keeps for a while, does not count.
  grpc::Status refused() const {
    return place_ == nullptr ? status(peer_limit(address_, most_, "open uploads")) : grpc::Status::OK;
  }

  /// Handles a message; the first must be the header. Both calls have the same two kinds of messages.
  template <class Request>
  grpc::Status take(const Request& request) {
    if (request.has_header()) return begin(request.header());
    if (request.has_chunk()) return append(request.chunk());
    return status(bad_request("A message has neither a header nor a chunk."));
  }
  /// Finishes the upload after the client has sent everything.
  grpc::Status complete();

  /// The number of bytes that the client need not send again.
  std::int64_t committed() const { return committed_; }
  /// The mesh, once it is in the store.
  const std::optional<v1::StoredMesh>& stored() const { return stored_; }

 private:
  grpc::Status begin(const v1::UploadHeader& header);
  grpc::Status append(const v1::Chunk& chunk);
  void store(const StoredBytes& bytes);

  MeshStore& meshes_;
  const std::string address_;
  const int most_;
  const std::shared_ptr<const void> place_;
  std::optional<UploadTicket> ticket_;
  std::int64_t committed_ = 0;
  std::string buffer_;
  std::optional<v1::StoredMesh> stored_;
};

}  // namespace varimesh::server
