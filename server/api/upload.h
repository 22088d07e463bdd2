// An upload as its messages come, whichever call brings them.
#pragma once

#include <grpcpp/support/status.h>

#include <optional>

#include "server/api/context.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::server {

/// Takes the messages of one stream, by one thread at a time.
class UploadSession {
 public:
  UploadSession(const ApiContext& api, const std::string& peer)
      : meshes_(api.meshes),
        address_(peer_address(peer)),
        most_(api.uploads.most()),
        place_(api.uploads.take(address_)) {}

  /// Not OK where the peer has too many streams open already that upload. Uploads whose stream was cut, and which the
  /// store keeps for a while, are not counted.
  grpc::Status refused() const {
    return place_ == nullptr ? peer_limit_status(address_, most_, "uploads") : grpc::Status::OK;
  }

  /// A message that came, the header first; both calls have the same two kinds.
  template <class Request>
  grpc::Status take(const Request& request) {
    if (request.has_header()) return begin(request.header());
    if (request.has_chunk()) return append(request.chunk());
    return refuse("A message has neither a header nor a chunk.");
  }
  /// The client has sent everything.
  grpc::Status complete();

  /// Bytes that need not be sent again.
  std::int64_t committed() const { return committed_; }
  /// The mesh, once it is in the store.
  const std::optional<v1::StoredMesh>& stored() const { return stored_; }

 private:
  grpc::Status begin(const v1::UploadHeader& header);
  grpc::Status append(const v1::Chunk& chunk);
  static grpc::Status refuse(const char* sentence);
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
