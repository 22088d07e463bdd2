// The reactor of OptimiseService: reads the spec and the mesh, submits, then writes events and results.
#include "server/api/optimise_service.h"

#include <optional>

#include "server/api/chunks.h"
#include "server/api/event_source.h"
#include "server/api/sources.h"

namespace varimesh::server {
namespace {

using Code = Failure::Code;

class OneCall : public grpc::ServerBidiReactor<v1::OptimiseRequest, v1::OptimiseResponse>,
                public Call,
                public Listener {
 public:
  static OneCall* open(const ApiContext& api, grpc::CallbackServerContext* call) {
    std::shared_ptr<OneCall> stream(new OneCall(api, call));
    stream->self_ = stream;
    stream->weak_ = stream;
    if (!api.calls.add(stream))
      stream->end(stopping_status());
    else if (stream->upload_ == nullptr)
      stream->end(peer_limit_status(stream->address_, api.uploads.most(), "uploads"));
    else if (stream->watch_ == nullptr)
      stream->end(peer_limit_status(stream->address_, api.watches.most(), "watches"));
    else
      stream->read();
    return stream.get();
  }

  void OnReadDone(bool ok) override {
    if (pump_.finished()) return;
    api_.pool.post([this, ok, alive = weak_.lock()] {
      if (alive == nullptr) return;
      const grpc::Status status = guarded([&] { return ok ? take() : submit(); });
      if (!status.ok()) end(status);
      if (status.ok() && ok) read();
    });
  }
  void OnWriteDone(bool ok) override { pump_.on_write_done(ok); }
  void OnCancel() override { end(grpc::Status::CANCELLED); }
  void OnDone() override {
    const std::shared_ptr<OneCall> last = std::move(self_);
    api_.calls.remove(last);
  }
  void end(const grpc::Status& status) override { pump_.end(status); }
  void tick(std::chrono::steady_clock::time_point now) override { pump_.tick(now); }
  void poke() override { pump_.poke(); }

 private:
  OneCall(const ApiContext& api, grpc::CallbackServerContext* call)
      : api_(api),
        address_(peer_address(call->peer())),
        upload_(api.uploads.take(address_)),
        watch_(api.watches.take(address_)),
        pump_(api.pool, api.limits,
              {[this](const v1::OptimiseResponse* response) { StartWrite(response); },
               [this](const grpc::Status& status) { Finish(status); }, [call] { call->TryCancel(); }}) {}

  static grpc::Status refuse(const char* sentence) {
    return status(Failure{Code::InvalidArgument, "BAD_REQUEST", sentence, {}, 0});
  }

  void read() {
    pump_.unless_finished([this] { StartRead(&request_); });
  }

  /// A message that came: the spec, or a chunk of the mesh.
  grpc::Status take() {
    if (request_.has_spec()) {
      if (spec_) return refuse("The spec must be sent once, first.");
      if (request_.spec().size() > api_.limits.max_mesh_bytes) return too_large();
      spec_ = std::move(*request_.mutable_spec());
      auto writer = api_.meshes.create();
      if (!writer) return status(writer.error());
      writer_ = std::move(*writer);
      return grpc::Status::OK;
    }
    if (!spec_) return refuse("The spec must be sent first.");
    const v1::Chunk& chunk = request_.chunk();
    if (!request_.has_chunk()) return refuse("A message has neither a spec nor a chunk.");
    const auto bytes = bytes_of(chunk, &buffer_);
    if (!bytes) return status(bytes.error());
    if (chunk.offset() != received_) return refuse("The chunks must come in order, each with its offset.");
    received_ += static_cast<std::int64_t>(bytes->size());
    if (received_ > api_.limits.max_mesh_bytes) return too_large();
    if (writer_->append(*bytes)) return grpc::Status::OK;
    return status(Failure{Code::ResourceExhausted,
                          "STORE_FULL",
                          "The server's disk takes no more; free space there, or ask whoever runs it.",
                          {},
                          30});
  }

  grpc::Status too_large() const {
    return status(Failure{Code::ResourceExhausted,
                          "MESH_TOO_LARGE",
                          "The mesh has more than the " + std::to_string(api_.limits.max_mesh_bytes) +
                              " bytes that the server takes (its flag --max-mesh-bytes).",
                          {},
                          0});
  }

  /// Everything is there: queue the job and begin to write.
  grpc::Status submit() {
    if (!spec_) return refuse("The stream ended before its spec.");
    if (spec_->size() > 0 && spec_->size() != received_) return refuse("The stream ended before the end of the mesh.");
    const auto stored = writer_->commit();
    writer_.reset();
    upload_.reset();
    if (!stored) return status(stored.error());
    v1::JobSpec spec = spec_->spec();
    spec.mutable_mesh()->set_digest(stored->digest);
    const auto job = api_.scheduler.submit(spec_->request_id(), spec, false, address_);  // pins the mesh
    api_.meshes.release(stored->digest);
    if (!job) return status(job.error());
    auto log = api_.scheduler.events(job->name());
    if (!log) return status(log.error());
    accepted_ = *job;
    events_.emplace(*log, 0, std::chrono::nanoseconds(0));
    (*log)->subscribe(std::weak_ptr<Listener>(std::static_pointer_cast<Listener>(weak_.lock())));
    pump_.start(weak_, [this](v1::OptimiseResponse* response, bool idle, grpc::Status* ended) {
      return pull(response, idle, ended);
    });
    return grpc::Status::OK;
  }

  Pull pull(v1::OptimiseResponse* response, bool idle, grpc::Status* ended) {
    if (!accepted_sent_) {
      accepted_sent_ = true;
      *response->mutable_accepted() = *accepted_;
      return Pull::Message;
    }
    if (!results_) {
      const Pull got = events_->pull(response->mutable_event(), idle);
      if (got != Pull::End) return got;
      response->Clear();
      const auto job = api_.scheduler.get(accepted_->name());
      if (!job) *ended = status(job.error());
      if (!job || job->results().empty()) return Pull::End;
      results_.emplace(api_, *job, true);
    }
    ResultSource::Piece piece;
    const auto more = results_->pull(&piece);
    if (!more) *ended = status(more.error());
    if (!more || !*more) return Pull::End;
    if (piece.job) *response->mutable_finished() = std::move(*piece.job);
    if (piece.history) *response->mutable_history() = std::move(*piece.history);
    if (piece.chunk) *response->mutable_chunk() = std::move(*piece.chunk);
    return Pull::Message;
  }

  const ApiContext& api_;
  const std::string address_;
  std::shared_ptr<const void> upload_, watch_;  ///< Its places among the peer's.
  Pump<v1::OptimiseResponse> pump_;
  v1::OptimiseRequest request_;
  // By the pool alone, one task at a time.
  std::optional<v1::OptimiseSpec> spec_;
  std::unique_ptr<BlobWriter> writer_;
  std::int64_t received_ = 0;
  std::string buffer_;
  std::optional<v1::Job> accepted_;
  bool accepted_sent_ = false;
  std::optional<EventSource> events_;
  std::optional<ResultSource> results_;
  std::shared_ptr<OneCall> self_;  ///< gRPC's reference; dropped in OnDone.
  std::weak_ptr<OneCall> weak_;
};

}  // namespace

grpc::ServerBidiReactor<v1::OptimiseRequest, v1::OptimiseResponse>* OptimiseService::Optimise(
    grpc::CallbackServerContext* call) {
  return OneCall::open(api_, call);
}

}  // namespace varimesh::server
