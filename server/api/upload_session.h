// An upload, message by message. UploadMesh and SendMesh share it.
#pragma once

#include <grpcpp/support/status.h>

#include <optional>

#include "server/api/context.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::server {

/// Handles the messages of one stream. One thread at a time.
class UploadSession {
 public:
  /// `view`: what the caller may see, or why the caller is not let in.
  UploadSession(const ApiContext& api, Answer<CallersView> view)
      : view_(std::move(view)),
        most_(api.uploads.most()),
        place_(view_ ? api.uploads.take(view_->caller().peer) : nullptr) {}

  /// Returns an error if the caller is not let in, or already has as many open uploads as one caller may have. An
  /// upload whose stream was cut, and which the store keeps for a while, does not count.
  grpc::Status refused() const {
    if (!view_) return status(view_.error());
    return place_ == nullptr ? status(peer_limit(view_->caller().peer, most_, "open uploads")) : grpc::Status::OK;
  }

  /// Whose upload it is; empty for a caller who is not let in.
  std::string caller() const { return view_ ? view_->caller().peer : ""; }

  /// Handles a message of a caller who is not refused; the first must be the header. Both calls have the same two kinds
  /// of messages.
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

  const Answer<CallersView> view_;
  const int most_;
  const std::shared_ptr<const void> place_;
  std::optional<UploadTicket> ticket_;
  std::int64_t committed_ = 0;
  std::string buffer_;
  std::optional<v1::StoredMesh> stored_;
};

}  // namespace varimesh::server
