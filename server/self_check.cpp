// Calls the health service over a connection of its own.
#include "server/self_check.h"

#include <grpcpp/grpcpp.h>

#include <utility>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/tls/tls.h"

namespace varimesh::server {

std::string own_address(const std::string& address) {
  const auto colon = address.rfind(':');
  const std::string host = address.substr(0, colon);
  if (host == "0.0.0.0") return "127.0.0.1" + address.substr(colon);
  if (host == "[::]") return "[::1]" + address.substr(colon);
  return address;
}

SelfCheck::SelfCheck(std::string address, bool tls, std::chrono::milliseconds patience)
    : address_(own_address(address)), tls_(tls), patience_(patience), answers_(address.empty()) {}

void SelfCheck::dial() {
  if (address_.empty()) return;
  if (tls_) {
    answers_ = speaks_tls(address_, patience_);
    return;
  }
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);  // otherwise an open connection would be used again
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  const auto stub = grpc::health::v1::Health::NewStub(
      grpc::CreateCustomChannel(address_, grpc::InsecureChannelCredentials(), arguments));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + patience_);
  grpc::health::v1::HealthCheckResponse response;
  answers_ = stub->Check(&context, {}, &response).ok();
}

}  // namespace varimesh::server
