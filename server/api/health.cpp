// Health checks and watches of the health.
#include "server/api/health.h"

#include <array>
#include <string_view>
#include <utility>

namespace varimesh::server {
namespace {

using grpc::health::v1::HealthCheckRequest, grpc::health::v1::HealthCheckResponse;

/// The largest request, in bytes: it has one name, and everybody may send it.
constexpr std::size_t kMostBytes = 1024;

constexpr std::array<std::string_view, 4> kServices{"", "varimesh.v1.MeshService", "varimesh.v1.JobService",
                                                    "varimesh.v1.OptimiseService"};

}  // namespace

HealthService::HealthService(const ApiContext& api) : api_(api), open_(api.limits.max_watches_per_peer) {
  MarkMethodRawCallback(index_of("grpc.health.v1.Health.Check"), unparsed(this, &HealthService::check));
  MarkMethodRawCallback(index_of("grpc.health.v1.Health.Watch"), unparsed(this, &HealthService::watch));
}

void HealthService::set_serving(bool serving) {
  std::vector<std::weak_ptr<Listener>> watchers;
  {
    std::lock_guard lock(mutex_);
    if (std::exchange(serving_, serving) == serving) return;
    std::erase_if(watchers_, [](const auto& watcher) { return watcher.expired(); });
    watchers = watchers_;
  }
  for (const auto& weak : watchers)
    if (const auto watcher = weak.lock()) watcher->poke();
}

HealthCheckResponse::ServingStatus HealthService::state(const std::string& service) {
  if (std::find(kServices.begin(), kServices.end(), service) == kServices.end())
    return HealthCheckResponse::SERVICE_UNKNOWN;
  std::lock_guard lock(mutex_);
  return serving_ ? HealthCheckResponse::SERVING : HealthCheckResponse::NOT_SERVING;
}

grpc::ServerUnaryReactor* HealthService::check(grpc::CallbackServerContext* call, const grpc::ByteBuffer* bytes,
                                               Response* response) {
  // Answered on this thread, since a probe must not wait for the pool.
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  const auto request = parse<HealthCheckRequest>(*bytes, kMostBytes);
  if (!request) {
    reactor->Finish(status(request.error()));
    return reactor;
  }
  const auto found = state(request->service());
  response->set_status(found);
  reactor->Finish(found == HealthCheckResponse::SERVICE_UNKNOWN
                      ? grpc::Status(grpc::StatusCode::NOT_FOUND, "This server has no service of that name.")
                      : grpc::Status::OK);
  return reactor;
}

grpc::ServerWriteReactor<HealthCheckResponse>* HealthService::watch(grpc::CallbackServerContext* call,
                                                                    const grpc::ByteBuffer* bytes) {
  using Stream = StreamOut<HealthCheckResponse>;
  const std::string address = peer_address(call->peer());
  const auto request = parse<HealthCheckRequest>(*bytes, kMostBytes);
  Answer<Stream::Source> source = peer_limit(address, open_.most(), "open watches of the health");
  if (!request)
    source = tl::unexpected(request.error());
  else if (auto place = open_.take(address); place != nullptr)
    source = Stream::Source([this, place = std::move(place), service = request->service(),
                             last = std::make_shared<int>(-1)](HealthCheckResponse* response, bool, grpc::Status*) {
      const auto now = state(service);
      if (now == *last) return Pull::Wait;
      *last = now;
      response->set_status(now);
      return Pull::Message;
    });
  return Stream::open(api_, call, std::move(source), [this](std::weak_ptr<Listener> listener) {
    std::lock_guard lock(mutex_);
    std::erase_if(watchers_, [](const auto& watcher) { return watcher.expired(); });
    watchers_.push_back(std::move(listener));
  });
}

}  // namespace varimesh::server
