// An interceptor of all calls.
#include "server/metrics/call_counter.h"

#include <algorithm>
#include <string_view>

#include "server/access/rights.h"

namespace varimesh::server {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

class Counter : public grpc::experimental::Interceptor {
 public:
  Counter(ServerRpcInfo* call, Metrics& metrics) : call_(call), metrics_(metrics) {}

  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_STATUS))
      metrics_.count_call(call_->method(), methods->GetSendStatus().error_code());
    methods->Proceed();
  }

 private:
  ServerRpcInfo* const call_;
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
