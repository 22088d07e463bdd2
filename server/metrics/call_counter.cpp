// An interceptor of all calls.
#include "server/metrics/call_counter.h"

#include <grpcpp/support/byte_buffer.h>

#include <algorithm>
#include <chrono>
#include <string_view>

#include "server/access/rights.h"
#include "varimesh/v1/service.pb.h"

namespace varimesh::server {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

/// The size of a message that is not parsed yet: a part of a mesh, and a few bytes around it. gRPC passes messages
/// without their types.
std::int64_t received_bytes(const void* message) {
  return message == nullptr ? 0 : static_cast<std::int64_t>(static_cast<const grpc::ByteBuffer*>(message)->Length());
}
/// The bytes of a mesh in a message of one of these types.
template <class Message>
std::int64_t chunk_bytes(const void* message) {
  return message == nullptr ? 0 : static_cast<const Message*>(message)->chunk().data().size();
}
template <class Message>
std::int64_t result_bytes(const void* message) {
  return message == nullptr ? 0 : static_cast<const Message*>(message)->chunk().chunk().data().size();
}

/// A method whose messages carry meshes, and how their bytes are counted. Null: they carry none in this direction.
struct Carrier {
  std::string_view name;
  std::int64_t (*received)(const void* message);
  std::int64_t (*sent)(const void* message);
};
constexpr Carrier kCarriers[] = {
    {"/varimesh.v1.MeshService/UploadMesh", received_bytes, nullptr},
    {"/varimesh.v1.MeshService/SendMesh", received_bytes, nullptr},
    {"/varimesh.v1.MeshService/DownloadMesh", nullptr, chunk_bytes<v1::DownloadMeshResponse>},
    {"/varimesh.v1.JobService/GetResult", nullptr, result_bytes<v1::GetResultResponse>},
    {"/varimesh.v1.OptimiseService/Optimise", received_bytes, result_bytes<v1::OptimiseResponse>}};

class Counter : public grpc::experimental::Interceptor {
 public:
  Counter(ServerRpcInfo* call, Metrics& metrics) : call_(call), metrics_(metrics) {
    for (const Carrier& carrier : kCarriers)
      if (carrier.name == call->method()) carrier_ = &carrier;
  }

  void Intercept(InterceptorBatchMethods* methods) override {
    if (carrier_ != nullptr && carrier_->received != nullptr &&
        methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_MESSAGE))
      metrics_.count_bytes(true, carrier_->received(methods->GetRecvMessage()));
    if (carrier_ != nullptr && carrier_->sent != nullptr &&
        methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_MESSAGE))
      metrics_.count_bytes(false, carrier_->sent(methods->GetSendMessage()));
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS))
      metrics_.count_call(call_->method(), methods->GetSendStatus().error_code(),
                          std::chrono::steady_clock::now() - began_);
    methods->Proceed();
  }

 private:
  ServerRpcInfo* const call_;
  const std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
  const Carrier* carrier_ = nullptr;
  Metrics& metrics_;
};

class Counters : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit Counters(Metrics& metrics) : metrics_(metrics) {}
  grpc::experimental::Interceptor* CreateServerInterceptor(ServerRpcInfo* call) override {
    // Clients may call methods by any name, and each name would be kept for ever.
    const std::string_view name = call->method();
    const bool is_known = name == "/grpc.health.v1.Health/Check" || name == "/grpc.health.v1.Health/Watch" ||
                          std::ranges::find(method_rules(), name, &MethodRule::name) != method_rules().end();
    return is_known ? new Counter(call, metrics_) : nullptr;
  }

 private:
  Metrics& metrics_;
};

}  // namespace

InterceptorFactory call_counter(Metrics& metrics) { return std::make_unique<Counters>(metrics); }

}  // namespace varimesh::server
