// A server-streaming gRPC reactor that uses a Pump.
#pragma once

#include <grpcpp/grpcpp.h>

#include <functional>
#include <memory>

#include "server/api/context.h"
#include "server/streams/pump.h"

namespace varimesh::server {

/// A server-streaming call that writes the messages of a source. It exists until OnDone(), and as long as the pool
/// works for it.
template <class Response>
class StreamOut : public grpc::ServerWriteReactor<Response>, public Call, public Listener {
 public:
  using Source = typename Pump<Response>::Source;
  using Subscribe = std::function<void(std::weak_ptr<Listener>)>;

  /// Starts the stream of a caller who is let in. `make_source` gets what the caller may see. `subscribe` registers the
  /// stream as a listener that is poked when the source may have more.
  static grpc::ServerWriteReactor<Response>* open(
      const ApiContext& api, grpc::CallbackServerContext* call, Method method,
      const std::function<Answer<Source>(const CallersView& view)>& make_source, const Subscribe& subscribe = {}) {
    const auto view = admit(api, *call, method);
    if (!view) return refuse(api, call, status(view.error()));
    return open(api, call, make_source(*view), subscribe, pool_of(api, method), view->caller().peer);
  }

  /// Starts a stream that everybody may have.
  static grpc::ServerWriteReactor<Response>* open(const ApiContext& api, grpc::CallbackServerContext* call,
                                                  Answer<Source> source, const Subscribe& subscribe) {
    return open(api, call, std::move(source), subscribe, api.pool, peer_address(call->peer()));
  }

  void OnWriteDone(bool ok) override { pump_.on_write_done(ok); }
  void OnCancel() override { pump_.end(grpc::Status::CANCELLED); }
  void OnDone() override {
    const std::shared_ptr<StreamOut> last = std::move(self_);
    calls_.remove(last);
  }
  void end(const grpc::Status& status) override { pump_.end(status); }
  void tick(std::chrono::steady_clock::time_point now) override { pump_.tick(now); }
  void poke() override { pump_.poke(); }

 private:
  static grpc::ServerWriteReactor<Response>* open(const ApiContext& api, grpc::CallbackServerContext* call,
                                                  Answer<Source> source, const Subscribe& subscribe, Pool& pool,
                                                  const std::string& caller) {
    if (!source) return refuse(api, call, status(source.error()));
    auto stream = make(api, call, pool, caller);
    if (subscribe) subscribe(std::weak_ptr<Listener>(stream));
    stream->pump_.start(stream, std::move(*source));
    return stream.get();
  }

  /// Ends the call at once with a status.
  static grpc::ServerWriteReactor<Response>* refuse(const ApiContext& api, grpc::CallbackServerContext* call,
                                                    const grpc::Status& why) {
    auto stream = make(api, call, api.pool, {});
    stream->end(why);
    return stream.get();
  }

  StreamOut(const ApiContext& api, grpc::CallbackServerContext* call, Pool& pool, const std::string& caller)
      : calls_(api.calls),
        pump_(pool, api.limits,
              {[this](const Response* response) { this->StartWrite(response); },
               [this](const grpc::Status& status) { this->Finish(status); }, [call] { call->TryCancel(); }},
              caller) {}

  static std::shared_ptr<StreamOut> make(const ApiContext& api, grpc::CallbackServerContext* call, Pool& pool,
                                         const std::string& caller) {
    std::shared_ptr<StreamOut> stream(new StreamOut(api, call, pool, caller));
    stream->self_ = stream;
    if (!api.calls.add(stream)) stream->end(stopping_status());
    return stream;
  }

  CallRegistry& calls_;
  Pump<Response> pump_;
  std::shared_ptr<StreamOut> self_;  ///< Keeps this object alive until OnDone().
};

}  // namespace varimesh::server
