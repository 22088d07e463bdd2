// Reactors of MeshService.
#include "server/api/mesh_service.h"

#include <chrono>
#include <optional>

#include "server/api/upload_session.h"

namespace varimesh::server {
namespace {

using Clock = std::chrono::steady_clock;

/// The time of a read that has not begun.
constexpr Clock::time_point kNever = Clock::time_point::max();

grpc::Status idle_status() {
  return status(upload_not_found("The upload was dropped because no data arrived for " +
                                 std::to_string(kUploadLifetime.count()) + " minutes"));
}

/// A stream with the messages of an upload. It reads a message, stores it on the pool, and reads the next.
template <class Reactor, class Request>
class Receiving : public Reactor, public Call {
 public:
  /// Starts the stream and returns the reactor for gRPC. `self` is this object, which keeps itself alive until
  /// OnDone().
  Reactor* open(const std::shared_ptr<Receiving>& self) {
    self_ = self;
    const grpc::Status refused = api_.calls.add(self) ? session_.refused() : stopping_status();
    if (!refused.ok()) {
      end(refused);
      return this;
    }
    std::lock_guard lock(mutex_);
    if (!finished_) read();
    return this;
  }

  void OnReadDone(bool ok) override {
    std::lock_guard lock(mutex_);
    reading_since_ = kNever;
    if (finished_) return;
    pool_of(api_, bytes_)
        .post(
            [this, ok, alive = self_] {
              const grpc::Status status = guarded([&] { return ok ? take() : session_.complete(); });
              if (!status.ok()) return end(status);
              std::lock_guard inner(mutex_);
              if (finished_) return;
              answer();
              if (!session_.stored()) read();
            },
            session_.caller());
  }
  void OnCancel() override { end(grpc::Status::CANCELLED); }
  void OnDone() override {
    std::unique_lock lock(mutex_);
    const std::shared_ptr<Receiving> last = std::move(self_);
    lock.unlock();
    api_.calls.remove(last);
  }
  void end(const grpc::Status& status) override {
    std::lock_guard lock(mutex_);
    if (!std::exchange(finished_, true)) this->Finish(status);
  }
  /// Ends a stream whose client sends nothing for as long as the store keeps an idle upload.
  void tick(Clock::time_point now) override {
    std::unique_lock lock(mutex_);
    const bool is_idle = now - reading_since_ > kUploadLifetime;
    lock.unlock();
    if (is_idle) end(idle_status());
  }

 protected:
  Receiving(const ApiContext& api, const grpc::CallbackServerContext& call, Method method)
      : api_(api), session_(api, admit(api, call, method)) {}

  /// Called with the lock held after session_ has handled a message.
  virtual void answer() = 0;

  const ApiContext& api_;
  UploadSession session_;  ///< Used only on the pool, by one task at a time.
  std::mutex mutex_;
  bool finished_ = false;
  std::shared_ptr<Receiving> self_;  ///< Keeps this object alive until OnDone().

 private:
  grpc::Status take() {
    const auto parsed = parse_chunk(bytes_, &request_);
    bytes_.Clear();
    return parsed ? session_.take(request_) : status(parsed.error());
  }

  /// Requires the lock.
  void read() {
    reading_since_ = Clock::now();
    this->StartRead(&bytes_);
  }

  grpc::ByteBuffer bytes_;  ///< Used by gRPC during a read, and by the pool after it.
  Request request_;         ///< Used only on the pool.
  Clock::time_point reading_since_ = kNever;
};

/// UploadMesh: one answer at the end, with the mesh.
class Upload final : public Receiving<grpc::ServerReadReactor<grpc::ByteBuffer>, v1::UploadMeshRequest> {
 public:
  Upload(const ApiContext& api, const grpc::CallbackServerContext& call, v1::UploadMeshResponse* response)
      : Receiving(api, call, Method::UploadMesh), response_(response) {}

 private:
  void answer() override {
    if (!session_.stored()) return;
    *response_->mutable_mesh() = *session_.stored();
    finished_ = true;
    Finish(grpc::Status::OK);
  }

  v1::UploadMeshResponse* const response_;  ///< Owned by gRPC; invalid once the call is finished.
};

/// SendMesh: acknowledges the stored bytes as soon as the previous answer has been written.
class Sending final
    : public Receiving<grpc::ServerBidiReactor<grpc::ByteBuffer, v1::SendMeshResponse>, v1::SendMeshRequest> {
 public:
  Sending(const ApiContext& api, grpc::CallbackServerContext* call)
      : Receiving(api, *call, Method::SendMesh), call_(call) {}

  void OnWriteDone(bool ok) override {
    std::lock_guard lock(mutex_);
    writing_ = false;
    if (ok) acknowledge();
  }
  void tick(Clock::time_point now) override {
    {
      std::lock_guard lock(mutex_);
      // The context exists as long as gRPC refers to this reactor.
      if (self_ != nullptr && writing_ && now - writing_since_ > api_.limits.stalled_reader) call_->TryCancel();
    }
    Receiving::tick(now);
  }

 private:
  void answer() override {
    committed_ = session_.committed();
    stored_ = session_.stored();
    acknowledge();
  }

  /// Requires the lock.
  void acknowledge() {
    if (finished_ || writing_) return;
    if (stored_) {
      *response_.mutable_mesh() = *stored_;
      finished_ = true;
      begin_write();
      StartWriteAndFinish(&response_, grpc::WriteOptions(), grpc::Status::OK);
    } else if (committed_ != acknowledged_) {
      response_.set_committed_size(acknowledged_ = committed_);
      begin_write();
      StartWrite(&response_);
    }
  }

  void begin_write() {
    writing_ = true;
    writing_since_ = Clock::now();
  }

  grpc::CallbackServerContext* const call_;
  std::int64_t committed_ = 0, acknowledged_ = -1;
  std::optional<v1::StoredMesh> stored_;
  v1::SendMeshResponse response_;  ///< Used by gRPC during a write.
  bool writing_ = false;
  Clock::time_point writing_since_;
};

grpc::Status check_offset(std::int64_t offset, std::int64_t size) {
  if (offset >= 0 && offset <= size) return grpc::Status::OK;
  return status(offset_outside_mesh(offset, size));
}

/// Reads what a running job has shown of its mesh.
class ShownMesh : public BlobReader {
 public:
  explicit ShownMesh(std::shared_ptr<const std::string> bytes) : bytes_(std::move(bytes)) {}

  std::int64_t size() const override { return static_cast<std::int64_t>(bytes_->size()); }
  Answer<Piece> read(std::int64_t offset, bool) override {
    std::string piece = bytes_->substr(static_cast<std::size_t>(offset), kMaxChunkBytes);
    const auto size = static_cast<std::int64_t>(piece.size());
    return Piece{std::move(piece), size, false};
  }

 private:
  const std::shared_ptr<const std::string> bytes_;
};

/// The mesh that a request names, or that the job of the request has shown; null: it has shown none yet.
Answer<std::unique_ptr<BlobReader>> open_reader(const CallersView& view, const v1::DownloadMeshRequest& request) {
  if (request.job().empty()) return view.read(request.digest());
  if (!request.digest().empty()) return bad_request("Name a mesh or a job, not both.");
  if (request.offset() != 0)
    return bad_request("The mesh of a running job is another one at each call; begin at offset 0.");
  auto bytes = view.watch_mesh(request.job());
  if (!bytes) return tl::unexpected(bytes.error());
  return *bytes == nullptr ? nullptr : std::make_unique<ShownMesh>(std::move(*bytes));
}

}  // namespace

MeshService::MeshService(const ApiContext& api) : api_(api) {
  MarkMethodRawCallback(index_of("varimesh.v1.MeshService.UploadMesh"), unparsed(this, &MeshService::upload));
  MarkMethodRawCallback(index_of("varimesh.v1.MeshService.SendMesh"), unparsed(this, &MeshService::send));
  MarkMethodRawCallback(index_of("varimesh.v1.MeshService.QueryUpload"), unparsed(this, &MeshService::query));
  MarkMethodRawCallback(index_of("varimesh.v1.MeshService.DeleteMesh"), unparsed(this, &MeshService::remove));
  MarkMethodRawCallback(index_of("varimesh.v1.MeshService.DownloadMesh"), unparsed(this, &MeshService::download));
}

grpc::ServerReadReactor<grpc::ByteBuffer>* MeshService::upload(Call* call, v1::UploadMeshResponse* response) {
  const auto upload = std::make_shared<Upload>(api_, *call, response);
  return upload->open(upload);
}

grpc::ServerBidiReactor<grpc::ByteBuffer, v1::SendMeshResponse>* MeshService::send(Call* call) {
  const auto sending = std::make_shared<Sending>(api_, call);
  return sending->open(sending);
}

grpc::ServerUnaryReactor* MeshService::query(Call* call, const Request* bytes, v1::QueryUploadResponse* response) {
  const auto work = [response](const CallersView& view, const v1::QueryUploadRequest& request) {
    const auto progress = view.query_upload(request.upload_id(), request.digest());
    if (!progress) return status(progress.error());
    response->set_committed_size(progress->committed);
    response->set_complete(progress->complete);
    return grpc::Status::OK;
  };
  return unary<v1::QueryUploadRequest>(api_, call, Method::QueryUpload, bytes, work);
}

grpc::ServerUnaryReactor* MeshService::remove(Call* call, const Request* bytes, v1::DeleteMeshResponse*) {
  const auto work = [](const CallersView& view, const v1::DeleteMeshRequest& request) {
    const auto removed = view.remove_mesh(request.digest());
    return removed ? grpc::Status::OK : status(removed.error());
  };
  return unary<v1::DeleteMeshRequest>(api_, call, Method::DeleteMesh, bytes, work);
}

grpc::ServerWriteReactor<v1::DownloadMeshResponse>* MeshService::download(Call* call, const Request* bytes) {
  struct State {
    std::shared_ptr<const void> place;  // among the open downloads of the caller
    std::optional<std::unique_ptr<BlobCheck>> check;
    std::unique_ptr<BlobReader> reader;
    v1::DownloadMeshRequest request;
    bool first = true;
  };
  using Stream = StreamOut<v1::DownloadMeshResponse>;
  return Stream::open(
      api_, call, Method::DownloadMesh, [this, bytes](const CallersView& view) -> Answer<Stream::Source> {
        auto request = parse<v1::DownloadMeshRequest>(*bytes);
        if (!request) return tl::unexpected(request.error());
        auto state = std::make_shared<State>();
        const std::string& peer = view.caller().peer;
        state->place = api_.downloads.take(peer);
        if (state->place == nullptr) return peer_limit(peer, api_.downloads.most(), "open downloads");
        state->request = std::move(*request);
        // The first pull opens the mesh, on the pool.
        return Stream::Source([view, state](v1::DownloadMeshResponse* response, bool, grpc::Status* ended) {
          const std::int64_t offset = state->request.offset();
          if (state->reader == nullptr) {
            if (!state->check)
              state->check = state->request.job().empty() ? view.check(state->request.digest()) : nullptr;
            if (*state->check != nullptr && (*state->check)->step()) return Pull::Again;
            auto reader = open_reader(view, state->request);
            if (reader && *reader == nullptr) return Pull::End;
            *ended = reader ? check_offset(offset, (*reader)->size()) : status(reader.error());
            if (!ended->ok()) return Pull::End;
            state->reader = std::move(*reader);
            state->check->reset();  // it has the file open too
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
        });
      });
}

}  // namespace varimesh::server
