// An interceptor of the calls of reflection.
#include "server/access/reflection_guard.h"

#include <string_view>

#include "server/access/certificate_name.h"
#include "server/addresses.h"

namespace varimesh::server {
namespace {

using grpc::experimental::InterceptionHookPoints;
using grpc::experimental::InterceptorBatchMethods;
using grpc::experimental::ServerRpcInfo;

class Guard : public grpc::experimental::Interceptor {
 public:
  Guard(ServerRpcInfo* call, const Access& access) : call_(call), access_(access) {}

  void Intercept(InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::POST_RECV_INITIAL_METADATA)) {
      const auto* metadata = methods->GetRecvInitialMetadata();
      const auto header = metadata->find("authorization");
      const std::string_view authorization = header == metadata->end()
                                                 ? std::string_view()
                                                 : std::string_view(header->second.data(), header->second.size());
      const std::string name = access_.names_certificates() ? name_in_certificate(*call_->server_context()) : "";
      if (!access_.admit(Method::Reflection, authorization, peer_address(call_->server_context()->peer()), name))
        call_->server_context()->TryCancel();
    }
    methods->Proceed();
  }

 private:
  ServerRpcInfo* const call_;
  const Access& access_;
};

class Guards : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit Guards(const Access& access) : access_(access) {}
  grpc::experimental::Interceptor* CreateServerInterceptor(ServerRpcInfo* call) override {
    const bool is_reflection = std::string_view(call->method()).starts_with("/grpc.reflection.");
    return is_reflection ? new Guard(call, access_) : nullptr;
  }

 private:
  const Access& access_;
};

}  // namespace

InterceptorFactory reflection_guard(const Access& access) { return std::make_unique<Guards>(access); }

}  // namespace varimesh::server
