// Reactors of MeshService.
#include "server/api/mesh_service.h"

#include <optional>

namespace varimesh::server {
namespace {

using Code = Failure::Code;

/// An upload: reads a message, lets the pool store it, reads the next.
class Upload : public grpc::ServerReadReactor<v1::UploadMeshRequest>, public Call {
 public:
  static Upload* open(const ApiContext& api, v1::UploadMeshResponse* response) {
    std::shared_ptr<Upload> upload(new Upload(api, response));
    upload->self_ = upload;
    if (api.calls.add(upload))
      upload->read();
    else
      upload->end(stopping_status());
    return upload.get();
  }

  void OnReadDone(bool ok) override {
    std::lock_guard lock(mutex_);
    if (finished_) return;
    api_.pool.post([this, ok, alive = self_] {
      const grpc::Status status = guarded([&] { return ok ? take() : complete(); });
      if (!status.ok() || !ok || ticket_->complete)
        end(status);
      else
        read();
    });
  }
  void OnCancel() override { end(grpc::Status::CANCELLED); }
  void OnDone() override {
    std::unique_lock lock(mutex_);
    const std::shared_ptr<Upload> last = std::move(self_);
    lock.unlock();
    api_.calls.remove(last);
  }
  void end(const grpc::Status& status) override {
    std::lock_guard lock(mutex_);
    if (std::exchange(finished_, true)) return;
    Finish(status);
  }

 private:
  Upload(const ApiContext& api, v1::UploadMeshResponse* response) : api_(api), response_(response) {}

  void read() {
    std::lock_guard lock(mutex_);
    if (!finished_) StartRead(&request_);
  }

  /// A message that came: the header, or a chunk.
  grpc::Status take() {
    if (request_.has_header()) {
      if (ticket_) return refuse("The header must be sent once, first.");
      const v1::UploadHeader& header = request_.header();
      const auto ticket = api_.meshes.begin_upload(header.upload_id(), header.digest(), header.size());
      if (!ticket) return status(ticket.error());
      ticket_ = *ticket;
      if (ticket_->complete) answer({header.digest(), header.size()});
      return grpc::Status::OK;
    }
    if (!ticket_) return refuse("The header must be sent first.");
    if (!request_.has_chunk()) return refuse("A message has neither a header nor a chunk.");
    const v1::Chunk& chunk = request_.chunk();
    if (chunk.data().size() > kMaxChunkBytes) return refuse("A chunk has more than 1 MiB; send smaller ones.");
    const auto committed = api_.meshes.append(*ticket_, chunk.offset(), chunk.data());
    return committed ? grpc::Status::OK : status(committed.error());
  }

  /// The client has sent everything.
  grpc::Status complete() {
    if (!ticket_) return refuse("The stream ended before its header.");
    const auto stored = api_.meshes.finish_upload(*ticket_);
    if (!stored) return status(stored.error());
    answer(*stored);
    return grpc::Status::OK;
  }

  void answer(const StoredBytes& stored) {
    response_->mutable_mesh()->set_digest(stored.digest);
    response_->mutable_mesh()->set_size(stored.size);
  }

  static grpc::Status refuse(const char* sentence) {
    return status(Failure{Code::InvalidArgument, "BAD_REQUEST", sentence, {}, 0});
  }

  const ApiContext& api_;
  v1::UploadMeshResponse* const response_;
  v1::UploadMeshRequest request_;       ///< Touched by gRPC while it reads, by the pool after.
  std::optional<UploadTicket> ticket_;  ///< By the pool alone, one task at a time.
  std::mutex mutex_;
  bool finished_ = false;
  std::shared_ptr<Upload> self_;
};

}  // namespace

grpc::ServerReadReactor<v1::UploadMeshRequest>* MeshService::UploadMesh(grpc::CallbackServerContext*,
                                                                        v1::UploadMeshResponse* response) {
  return Upload::open(api_, response);
}

grpc::ServerUnaryReactor* MeshService::QueryUpload(grpc::CallbackServerContext* call,
                                                   const v1::QueryUploadRequest* request,
                                                   v1::QueryUploadResponse* response) {
  return unary(call, api_.pool, [this, request, response] {
    const auto progress = api_.meshes.query_upload(request->upload_id(), request->digest());
    if (!progress) return status(progress.error());
    response->set_committed_size(progress->committed);
    response->set_complete(progress->complete);
    return grpc::Status::OK;
  });
}

grpc::ServerWriteReactor<v1::DownloadMeshResponse>* MeshService::DownloadMesh(grpc::CallbackServerContext* call,
                                                                              const v1::DownloadMeshRequest* request) {
  struct State {
    std::shared_ptr<const Blob> blob;
    std::int64_t offset = 0;
    bool first = true;
  };
  auto state = std::make_shared<State>();
  // The mesh is opened by the first pull, on the pool.
  return StreamOut<v1::DownloadMeshResponse>::open(
      api_, call,
      Pump<v1::DownloadMeshResponse>::Source([this, state, digest = request->digest(), offset = request->offset()](
                                                 v1::DownloadMeshResponse* response, bool, grpc::Status* ended) {
        if (state->blob == nullptr) {
          auto blob = api_.meshes.open(digest);
          if (!blob) {
            *ended = status(blob.error());
            return Pull::End;
          }
          const auto size = static_cast<std::int64_t>((*blob)->bytes().size());
          if (offset < 0 || offset > size) {
            *ended = status(Failure{
                Code::OutOfRange,
                "WRONG_OFFSET",
                "The mesh has " + std::to_string(size) + " bytes, and the offset is " + std::to_string(offset) + ".",
                {{"size", std::to_string(size)}},
                0});
            return Pull::End;
          }
          state->blob = std::move(*blob);
          state->offset = offset;
        }
        const std::string_view bytes = state->blob->bytes();
        const std::string_view rest = bytes.substr(static_cast<std::size_t>(state->offset));
        if (rest.empty() && !state->first) return Pull::End;
        state->first = false;
        const std::string_view piece = rest.substr(0, kChunkBytes);
        response->set_size(static_cast<std::int64_t>(bytes.size()));
        response->mutable_chunk()->set_offset(state->offset);
        response->mutable_chunk()->set_data(piece.data(), piece.size());
        state->offset += static_cast<std::int64_t>(piece.size());
        if (state->offset % kForgetBytes < static_cast<std::int64_t>(piece.size()))
          state->blob->forget(static_cast<std::size_t>(state->offset));
        return Pull::Message;
      }));
}

}  // namespace varimesh::server
