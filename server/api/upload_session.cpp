// Passes the messages of an upload to the store.
#include "server/api/upload_session.h"

#include "server/api/chunks.h"

namespace varimesh::server {

grpc::Status UploadSession::begin(const v1::UploadHeader& header) {
  if (ticket_) return status(bad_request("The header must be sent exactly once, as the first message."));
  const auto ticket = view_->begin_upload(header.upload_id(), header.digest(), header.size());
  if (!ticket) return status(ticket.error());
  ticket_ = *ticket;
  committed_ = ticket_->committed;
  if (ticket_->complete) store({header.digest(), header.size()});
  return grpc::Status::OK;
}

grpc::Status UploadSession::append(const v1::Chunk& chunk) {
  if (!ticket_) return status(bad_request("The header must be sent before the first chunk."));
  const auto bytes = bytes_of(chunk, &buffer_);
  if (!bytes) return status(bytes.error());
  const auto committed = view_->append(*ticket_, chunk.offset(), *bytes);
  if (!committed) return status(committed.error());
  committed_ = *committed;
  return grpc::Status::OK;
}

grpc::Status UploadSession::complete() {
  if (!ticket_) return status(bad_request("The stream ended without a header."));
  const auto stored = view_->finish_upload(*ticket_);
  if (!stored) return status(stored.error());
  store(*stored);
  return grpc::Status::OK;
}

void UploadSession::store(const StoredBytes& bytes) {
  stored_.emplace();
  stored_->set_digest(bytes.digest);
  stored_->set_size(bytes.size);
}

}  // namespace varimesh::server
