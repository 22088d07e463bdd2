// From messages to the store.
#include "server/api/upload.h"

namespace varimesh::server {

grpc::Status UploadSession::begin(const v1::UploadHeader& header) {
  if (ticket_) return refuse("The header must be sent once, first.");
  const auto ticket = meshes_.begin_upload(header.upload_id(), header.digest(), header.size());
  if (!ticket) return status(ticket.error());
  ticket_ = *ticket;
  committed_ = ticket_->committed;
  if (ticket_->complete) store({header.digest(), header.size()});
  return grpc::Status::OK;
}

grpc::Status UploadSession::append(const v1::Chunk& chunk) {
  if (!ticket_) return refuse("The header must be sent first.");
  if (chunk.data().size() > kMaxChunkBytes) return refuse("A chunk has more than 1 MiB; send smaller ones.");
  const auto committed = meshes_.append(*ticket_, chunk.offset(), chunk.data());
  if (!committed) return status(committed.error());
  committed_ = *committed;
  return grpc::Status::OK;
}

grpc::Status UploadSession::complete() {
  if (!ticket_) return refuse("The stream ended before its header.");
  const auto stored = meshes_.finish_upload(*ticket_);
  if (!stored) return status(stored.error());
  store(*stored);
  return grpc::Status::OK;
}

grpc::Status UploadSession::refuse(const char* sentence) {
  return status(Failure{Failure::Code::InvalidArgument, "BAD_REQUEST", sentence, {}, 0});
}

void UploadSession::store(const StoredBytes& bytes) {
  stored_.emplace();
  stored_->set_digest(bytes.digest);
  stored_->set_size(bytes.size);
}

}  // namespace varimesh::server
