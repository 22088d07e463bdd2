// The reactor of OptimiseService. It reads the spec and the mesh, submits the job, and writes its events and its
// result.
#include "server/api/optimise_service.h"

#include <atomic>
#include <chrono>
#include <optional>

#include "server/api/chunks.h"
#include "server/api/result_source.h"
#include "server/meshes/disk.h"
#include "server/streams/event_source.h"

namespace varimesh::server {
namespace {

/// For how long a stream of unknown size that has ended waits for a sign that it was cut. gRPC tells both at the same
/// time, in any order.
constexpr std::chrono::milliseconds kPatienceWithCuts{50};

/// The stream of one call to Optimise.
class OptimiseStream : public grpc::ServerBidiReactor<grpc::ByteBuffer, v1::OptimiseResponse>,
                       public Call,
                       public Listener {
 public:
  static OptimiseStream* open(const ApiContext& api, grpc::CallbackServerContext* call) {
    std::shared_ptr<OptimiseStream> stream(new OptimiseStream(api, call));
    stream->self_ = stream;
    stream->weak_ = stream;
    if (!api.calls.add(stream))
      stream->end(stopping_status());
    else if (!stream->view_)
      stream->end(status(stream->view_.error()));
    else if (stream->upload_ == nullptr)
      stream->end(status(peer_limit(stream->view_->caller().peer, api.uploads.most(), "open uploads")));
    else if (stream->watch_ == nullptr)
      stream->end(status(peer_limit(stream->view_->caller().peer, api.watches.most(), "open watches")));
    else
      stream->read();
    return stream.get();
  }

  void OnReadDone(bool ok) override {
    if (pump_.finished()) return;
    post(ok ? bytes_ : spec_, [this, ok] {
      if (!ok && size_ && *size_ == 0)
        ended_at_ = std::chrono::steady_clock::now().time_since_epoch().count();
      else
        handle(ok);
    });
  }
  void OnWriteDone(bool ok) override { pump_.on_write_done(ok); }
  void OnCancel() override { end(grpc::Status::CANCELLED); }
  void OnDone() override {
    const std::shared_ptr<OptimiseStream> last = std::move(self_);
    api_.calls.remove(last);
  }
  void end(const grpc::Status& status) override { pump_.end(status); }
  void tick(std::chrono::steady_clock::time_point now) override {
    pump_.tick(now);
    std::int64_t ended = ended_at_;
    const std::chrono::steady_clock::time_point since{std::chrono::steady_clock::duration(ended)};
    if (ended == kNotEnded || now - since < kPatienceWithCuts || pump_.finished()) return;
    if (!ended_at_.compare_exchange_strong(ended, kNotEnded)) return;
    post(spec_, [this] {
      if (!pump_.finished()) handle(false);
    });
  }
  void poke() override { pump_.poke(); }

 private:
  OptimiseStream(const ApiContext& api, grpc::CallbackServerContext* call)
      : api_(api),
        view_(admit(api, *call, Method::Optimise)),
        upload_(view_ ? api.uploads.take(view_->caller().peer) : nullptr),
        watch_(view_ ? api.watches.take(view_->caller().peer) : nullptr),
        pump_(api.files, api.limits,
              {[this](const v1::OptimiseResponse* response) { StartWrite(response); },
               [this](const grpc::Status& status) { Finish(status); }, [call] { call->TryCancel(); }},
              peer()) {}

  std::string peer() const { return view_ ? view_->caller().peer : ""; }

  /// Runs `work` on the pool for the message that it parses, if this stream is still there.
  void post(const grpc::ByteBuffer& message, std::function<void()> work) {
    pool_of(api_, message)
        .post(
            [alive = weak_.lock(), work = std::move(work)] {
              if (alive != nullptr) work();
            },
            peer());
  }

  /// Handles a message or, if there was none, the end of what the client sends.
  void handle(bool message) {
    const LogScope scope(view_ ? view_->caller().log_fields() : LogFields());
    const grpc::Status status = guarded([&] { return message ? take() : submit(); });
    if (!status.ok()) {
      // A caller who is told so has the room again: the next stream may come at once.
      writer_.reset();
      kept_.reset();
      end(status);
    }
    if (status.ok() && message) read();
  }

  static grpc::Status refuse(const char* sentence) { return status(bad_request(sentence)); }

  void read() {
    pump_.unless_finished([this] { StartRead(&bytes_); });
  }

  /// Handles a message from the client: the spec, or a chunk of the mesh.
  grpc::Status take() {
    if (!size_) return take_spec();
    const auto parsed = parse_chunk(bytes_, &request_);
    bytes_.Clear();
    if (!parsed) return status(parsed.error());
    if (request_.has_spec()) return refuse("The spec must be sent exactly once, as the first message.");
    if (!request_.has_chunk()) return refuse("A message has neither a spec nor a chunk.");
    return take_chunk(request_.chunk());
  }

  grpc::Status take_spec() {
    const auto request = parse<v1::OptimiseRequest>(bytes_, kMostSpecBytes);
    if (!request) return status(request.error());
    if (!request->has_spec()) return refuse("The spec must be sent before the first chunk.");
    const std::int64_t size = request->spec().size();
    if (const auto checked = check_size(size, api_.limits.max_mesh_bytes, api_.limits.max_memory_bytes); !checked)
      return status(checked.error());
    kept_ = view_->keep_share();
    if (const auto room = keep(size); !room) return status(room.error());
    auto writer = view_->create(size);
    if (!writer) return status(writer.error());
    writer_ = std::move(*writer);
    size_ = size;
    spec_.Swap(&bytes_);
    bytes_.Clear();
    return grpc::Status::OK;
  }

  /// Keeps this many bytes of what the caller may store.
  Answer<void> keep(std::int64_t bytes) {
    if (kept_ == nullptr) return {};
    return kept_->raise_to(bytes);
  }

  grpc::Status take_chunk(const v1::Chunk& chunk) {
    const auto bytes = bytes_of(chunk, &buffer_);
    if (!bytes) return status(bytes.error());
    if (chunk.offset() != received_) return refuse("The chunks must be sent in order, each with its offset.");
    received_ += static_cast<std::int64_t>(bytes->size());
    if (received_ > api_.limits.max_mesh_bytes) return status(mesh_too_large(api_.limits.max_mesh_bytes));
    // Room is kept for what the spec announces. It need not announce anything.
    const std::int64_t announced = *size_;
    if (announced > 0 && received_ > announced) return refuse("More bytes came than the size in the spec.");
    if (announced == 0)
      if (const auto room = keep(received_); !room) return status(room.error());
    if (writer_->append(*bytes)) return grpc::Status::OK;
    return status(store_full("The server's disk has no room for the mesh"));
  }

  /// Submits the job when the client has sent everything, and starts to write.
  grpc::Status submit() {
    if (!size_) return refuse("The stream ended without a spec.");
    if (*size_ > 0 && *size_ != received_) return refuse("The stream ended before the end of the mesh.");
    const auto stored = writer_->commit();
    writer_.reset();
    upload_.reset();
    if (!stored) return status(stored.error());
    auto request = parse<v1::OptimiseRequest>(spec_, kMostSpecBytes);
    if (!request) return status(request.error());
    v1::JobSpec spec = std::move(*request->mutable_spec()->mutable_spec());  // which may have megabytes
    spec.mutable_mesh()->set_digest(stored->digest);
    if (kept_ != nullptr) kept_->grant(stored->digest);
    view_->hold(stored->digest);
    const auto job = view_->submit(request->spec().request_id(), spec, false);  // adds a reference to the mesh
    api_.meshes.release(stored->digest);
    view_->let_go(stored->digest);
    if (!job) return status(job.error());
    auto log = view_->events(job->name());
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
      const auto job = view_->get(accepted_->name());
      if (!job) *ended = status(job.error());
      if (!job || job->results().empty()) return Pull::End;
      results_.emplace(api_, *job, true);
    }
    ResultSource::Piece piece;
    const auto got = results_->pull(&piece);
    if (!got) *ended = status(got.error());
    if (!got || *got != Pull::Message) return got.value_or(Pull::End);
    if (piece.job) *response->mutable_finished() = std::move(*piece.job);
    if (piece.history) *response->mutable_history() = std::move(*piece.history);
    if (piece.chunk) *response->mutable_chunk() = std::move(*piece.chunk);
    return Pull::Message;
  }

  static constexpr std::int64_t kNotEnded = 0;

  const ApiContext& api_;
  std::atomic<std::int64_t> ended_at_ = kNotEnded;  ///< When a mesh of unknown size ended, on the steady clock.
  const Answer<CallersView> view_;                  ///< Or why the caller is not let in.
  std::shared_ptr<const void> upload_, watch_;      ///< Its places among the open uploads and watches of the caller.
  Pump<v1::OptimiseResponse> pump_;
  grpc::ByteBuffer bytes_;  ///< Used by gRPC during a read, and by the pool after it.
  // Used only on the pool, by one task at a time.
  v1::OptimiseRequest request_;
  std::optional<std::int64_t> size_;  ///< What the spec announces, in bytes, once it has come; 0: not known.
  grpc::ByteBuffer spec_;  ///< The message with the spec, which takes ten times its size when it is parsed: at the end.
  std::unique_ptr<BlobWriter> writer_;
  std::unique_ptr<KeptShare> kept_;  ///< For the mesh. Null: there is no limit.
  std::int64_t received_ = 0;
  std::string buffer_;
  std::optional<v1::Job> accepted_;
  bool accepted_sent_ = false;
  std::optional<EventSource> events_;
  std::optional<ResultSource> results_;
  std::shared_ptr<OptimiseStream> self_;  ///< Keeps this object alive until OnDone().
  std::weak_ptr<OptimiseStream> weak_;
};

}  // namespace

OptimiseService::OptimiseService(const ApiContext& api) : api_(api) {
  MarkMethodRawCallback(index_of("varimesh.v1.OptimiseService.Optimise"), unparsed(this, &OptimiseService::optimise));
}

grpc::ServerBidiReactor<grpc::ByteBuffer, v1::OptimiseResponse>* OptimiseService::optimise(
    grpc::CallbackServerContext* call) {
  return OptimiseStream::open(api_, call);
}

}  // namespace varimesh::server
