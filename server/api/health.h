// The gRPC health service.
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/api/stream_out.h"

namespace varimesh::server {

/// Answers NOT_SERVING until the server is ready and again while it stops, for the server as a whole ("") and for each
/// of its services.
class HealthService : public grpc::health::v1::Health::CallbackService {
 public:
  explicit HealthService(const ApiContext& api);

  void set_serving(bool serving);
  bool serving() {
    std::lock_guard lock(mutex_);
    return serving_;
  }

 private:
  using Response = grpc::health::v1::HealthCheckResponse;
  grpc::ServerUnaryReactor* check(grpc::CallbackServerContext* call, const grpc::ByteBuffer* request,
                                  Response* response);
  grpc::ServerWriteReactor<Response>* watch(grpc::CallbackServerContext* call, const grpc::ByteBuffer* request);
  grpc::health::v1::HealthCheckResponse::ServingStatus state(const std::string& service);

  const ApiContext& api_;
  PeerCounts open_;  ///< Watches of each address: who asks for the health needs no token.
  std::mutex mutex_;
  bool serving_ = false;
  std::vector<std::weak_ptr<Listener>> watchers_;
};

}  // namespace varimesh::server
