// Reactors of MeshService.
#include "server/api/mesh_service.h"

#include <chrono>
#include <optional>

#include "server/api/upload.h"

namespace varimesh::server {
namespace {

using Code = Failure::Code;
using Clock = std::chrono::steady_clock;

/// The store drops an upload that nobody touches for so long; a stream that only waits for its chunks goes with it.
constexpr std::chrono::minutes kIdleUpload{10};
constexpr Clock::time_point kNotNow = Clock::time_point::max();

grpc::Status idle_status() {
  return status(Failure{Code::NotFound,
                        "UPLOAD_NOT_FOUND",
                        "Nothing came for ten minutes, and the upload is dropped; begin it again.",
                        {},
                        0});
}

/// UploadMesh: reads a message, lets the pool store it, reads the next.
class Upload : public grpc::ServerReadReactor<v1::UploadMeshRequest>, public Call {
 public:
  static Upload* open(const ApiContext& api, const std::string& peer, v1::UploadMeshResponse* response) {
    std::shared_ptr<Upload> upload(new Upload(api, peer, response));
    upload->self_ = upload;
    const grpc::Status refused = api.calls.add(upload) ? upload->session_.refused() : stopping_status();
    if (refused.ok())
      upload->read();
    else
      upload->end(refused);
    return upload.get();
  }

  void OnReadDone(bool ok) override {
    std::lock_guard lock(mutex_);
    reading_since_ = kNotNow;
    if (finished_) return;
    api_.pool.post([this, ok, alive = self_] {
      const grpc::Status status = guarded([&] { return ok ? session_.take(request_) : session_.complete(); });
      if (!status.ok() || session_.stored())
        finish(status, session_.stored());
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
  void end(const grpc::Status& status) override { finish(status, std::nullopt); }
  void tick(Clock::time_point now) override {
    std::unique_lock lock(mutex_);
    const bool is_idle = now - reading_since_ > kIdleUpload;
    lock.unlock();
    if (is_idle) end(idle_status());
  }

 private:
  Upload(const ApiContext& api, const std::string& peer, v1::UploadMeshResponse* response)
      : api_(api), response_(response), session_(api, peer) {}

  void finish(const grpc::Status& status, const std::optional<v1::StoredMesh>& stored) {
    std::lock_guard lock(mutex_);
    if (std::exchange(finished_, true)) return;
    if (stored) *response_->mutable_mesh() = *stored;
    Finish(status);
  }

  void read() {
    std::lock_guard lock(mutex_);
    if (finished_) return;
    reading_since_ = Clock::now();
    StartRead(&request_);
  }

  const ApiContext& api_;
  v1::UploadMeshResponse* const response_;  ///< gRPC's, and gone once the call is finished.
  v1::UploadMeshRequest request_;           ///< Touched by gRPC while it reads, by the pool after.
  UploadSession session_;                   ///< By the pool alone, one task at a time.
  std::mutex mutex_;
  bool finished_ = false;
  Clock::time_point reading_since_ = kNotNow;
  std::shared_ptr<Upload> self_;
};

/// SendMesh: the same, and what is stored is said as soon as the answer before has gone.
class Sending : public grpc::ServerBidiReactor<v1::SendMeshRequest, v1::SendMeshResponse>, public Call {
 public:
  static Sending* open(const ApiContext& api, grpc::CallbackServerContext* call) {
    std::shared_ptr<Sending> sending(new Sending(api, call));
    sending->self_ = sending;
    const grpc::Status refused = api.calls.add(sending) ? sending->session_.refused() : stopping_status();
    if (refused.ok())
      sending->read();
    else
      sending->end(refused);
    return sending.get();
  }

  void OnReadDone(bool ok) override {
    std::lock_guard lock(mutex_);
    reading_since_ = kNotNow;
    if (finished_) return;
    api_.pool.post([this, ok, alive = self_] {
      const grpc::Status status = guarded([&] { return ok ? session_.take(request_) : session_.complete(); });
      if (!status.ok()) return end(status);
      {
        std::lock_guard inner(mutex_);
        committed_ = session_.committed();
        stored_ = session_.stored();
        say();
      }
      if (!session_.stored()) read();
    });
  }
  void OnWriteDone(bool ok) override {
    std::lock_guard lock(mutex_);
    writing_ = false;
    if (ok) say();
  }
  void OnCancel() override { end(grpc::Status::CANCELLED); }
  void OnDone() override {
    std::unique_lock lock(mutex_);
    const std::shared_ptr<Sending> last = std::move(self_);
    lock.unlock();
    api_.calls.remove(last);
  }
  void end(const grpc::Status& status) override {
    std::lock_guard lock(mutex_);
    if (std::exchange(finished_, true)) return;
    Finish(status);
  }
  void tick(Clock::time_point now) override {
    std::unique_lock lock(mutex_);
    // The context lives as long as gRPC refers to this.
    if (self_ != nullptr && writing_ && now - writing_since_ > api_.limits.stalled_reader) call_->TryCancel();
    const bool is_idle = now - reading_since_ > kIdleUpload;
    lock.unlock();
    if (is_idle) end(idle_status());
  }

 private:
  Sending(const ApiContext& api, grpc::CallbackServerContext* call)
      : api_(api), call_(call), session_(api, call->peer()) {}

  void read() {
    std::lock_guard lock(mutex_);
    if (finished_) return;
    reading_since_ = Clock::now();
    StartRead(&request_);
  }

  /// With the lock held.
  void say() {
    if (finished_ || writing_) return;
    if (stored_) {
      *response_.mutable_mesh() = *stored_;
      finished_ = true;
      begin_write();
      StartWriteAndFinish(&response_, grpc::WriteOptions(), grpc::Status::OK);
    } else if (committed_ != said_) {
      response_.set_committed_size(said_ = committed_);
      begin_write();
      StartWrite(&response_);
    }
  }

  void begin_write() {
    writing_ = true;
    writing_since_ = Clock::now();
  }

  const ApiContext& api_;
  grpc::CallbackServerContext* const call_;
  v1::SendMeshRequest request_;  ///< Touched by gRPC while it reads, by the pool after.
  UploadSession session_;        ///< By the pool alone, one task at a time.
  std::mutex mutex_;
  std::int64_t committed_ = 0, said_ = -1;
  std::optional<v1::StoredMesh> stored_;
  v1::SendMeshResponse response_;  ///< Touched by gRPC while it writes.
  bool writing_ = false;
  Clock::time_point writing_since_;
  bool finished_ = false;
  Clock::time_point reading_since_ = kNotNow;
  std::shared_ptr<Sending> self_;
};

grpc::Status check_offset(std::int64_t offset, std::int64_t size) {
  if (offset >= 0 && offset <= size) return grpc::Status::OK;
  return status(
      Failure{Code::OutOfRange,
              "WRONG_OFFSET",
              "The mesh has " + std::to_string(size) + " bytes, and the offset is " + std::to_string(offset) + ".",
              {{"size", std::to_string(size)}},
              0});
}

}  // namespace

grpc::ServerReadReactor<v1::UploadMeshRequest>* MeshService::UploadMesh(grpc::CallbackServerContext* call,
                                                                        v1::UploadMeshResponse* response) {
  return Upload::open(api_, call->peer(), response);
}

grpc::ServerBidiReactor<v1::SendMeshRequest, v1::SendMeshResponse>* MeshService::SendMesh(
    grpc::CallbackServerContext* call) {
  return Sending::open(api_, call);
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
    std::unique_ptr<BlobReader> reader;
    v1::DownloadMeshRequest request;
    bool first = true;
  };
  auto state = std::make_shared<State>();
  state->request = *request;
  // The mesh is opened by the first pull, on the pool.
  return StreamOut<v1::DownloadMeshResponse>::open(
      api_, call,
      Pump<v1::DownloadMeshResponse>::Source(
          [this, state](v1::DownloadMeshResponse* response, bool, grpc::Status* ended) {
            std::int64_t offset = state->request.offset();
            if (state->reader == nullptr) {
              auto reader = api_.meshes.read(state->request.digest());
              *ended = reader ? check_offset(offset, (*reader)->size()) : status(reader.error());
              if (!ended->ok()) return Pull::End;
              state->reader = std::move(*reader);
            }
            auto piece = state->reader->read(offset, state->request.encoding() == v1::ENCODING_ZSTD);
            if (!piece) *ended = status(piece.error());
            if (!piece || (piece->size == 0 && !std::exchange(state->first, false))) return Pull::End;
            state->first = false;
            state->request.set_offset(offset + piece->size);
            response->set_size(state->reader->size());
            response->mutable_chunk()->set_offset(offset);
            response->mutable_chunk()->set_data(std::move(piece->bytes));
            if (piece->is_zstd) response->mutable_chunk()->set_encoding(v1::ENCODING_ZSTD);
            return Pull::Message;
          }));
}

}  // namespace varimesh::server
