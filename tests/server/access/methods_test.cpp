// Every method asks who calls, and has its line in the table of rights.
#include <google/protobuf/descriptor.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/support/byte_buffer.h>

#include <algorithm>

#include "server/access/rights.h"
#include "server/api/requests.h"
#include "tests/server/access/owners.h"

namespace varimesh::server::testing {
namespace {

/// Returns the status of a call with one message, and closes the stream.
grpc::Status call_by_name(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                          const std::string& token, const std::string& message = "") {
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
  if (!token.empty()) context.AddMetadata("authorization", "Bearer " + token);
  grpc::CompletionQueue queue;
  const auto call = stub.PrepareCall(&context, method, &queue);
  const auto wait = [&queue] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  call->StartCall(&queue);
  wait();
  grpc::Slice bytes(message);
  call->WriteLast(grpc::ByteBuffer(&bytes, 1), grpc::WriteOptions(), &queue);
  wait();
  grpc::ByteBuffer answer;
  do {
    call->Read(&answer, &queue);
  } while (wait());
  grpc::Status status;
  call->Finish(&status, &queue);
  wait();
  return status;
}

/// "/varimesh.v1.JobService/GetJob" as descriptors have it.
std::string name_of(const std::string& method) {
  std::string name = method.substr(1);
  std::ranges::replace(name, '/', '.');
  return name;
}

std::vector<std::string> all_methods() {
  std::vector<std::string> methods;
  for (const char* name : {"varimesh.v1.MeshService", "varimesh.v1.JobService", "varimesh.v1.OptimiseService"}) {
    const auto* service = google::protobuf::DescriptorPool::generated_pool()->FindServiceByName(name);
    for (int i = 0; i < service->method_count(); ++i)
      methods.push_back(std::string("/") + name + "/" + service->method(i)->name());
  }
  return methods;
}

TEST_F(Owners, AreAskedByEveryMethod) {
  for (const std::string& method : all_methods()) {
    const auto refused = call_by_name(service_->channel, method, "");
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::UNAUTHENTICATED) << method;
    EXPECT_EQ(info_of(refused).reason(), "TOKEN_MISSING") << method;
    EXPECT_EQ(info_of(call_by_name(service_->channel, method, "token-of-nobody")).reason(), "TOKEN_UNKNOWN") << method;
    const auto admitted = call_by_name(service_->channel, method, kOperator).error_code();
    EXPECT_NE(admitted, grpc::StatusCode::UNAUTHENTICATED) << method;
    EXPECT_NE(admitted, grpc::StatusCode::PERMISSION_DENIED) << method;
  }
}

TEST_F(Owners, AreAskedBeforeTheirRequestIsParsed) {
  const std::string garbage = "\xff\xff", health = "/grpc.health.v1.Health/";
  std::string unknown;
  while (unknown.size() <= kMostRequestBytes)
    unknown += "\xfa\xff\x03\x00";  // a field that nobody knows, without bytes
  for (const std::string& method : all_methods()) {
    for (const std::string& message : {garbage, unknown})
      EXPECT_EQ(info_of(call_by_name(service_->channel, method, "", message)).reason(), "TOKEN_MISSING") << method;
    const auto* described = google::protobuf::DescriptorPool::generated_pool()->FindMethodByName(name_of(method));
    ASSERT_NE(described, nullptr) << method;
    if (described->client_streaming()) continue;  // it reads its first message when it knows who calls
    EXPECT_EQ(info_of(call_by_name(service_->channel, method, kOperator, garbage)).reason(), "BAD_REQUEST") << method;
    const grpc::Status large = call_by_name(service_->channel, method, kOperator, unknown);
    const bool is_too_large = large.error_message().find("may have 65536") != std::string::npos;
    EXPECT_EQ(is_too_large, method != "/varimesh.v1.JobService/SubmitJob") << method << large.error_message();
  }
  for (const std::string& method : {health + "Check", health + "Watch"})
    for (const std::string& message : {garbage, unknown})
      EXPECT_EQ(info_of(call_by_name(service_->channel, method, "", message)).reason(), "BAD_REQUEST") << method;
}

TEST_F(Owners, TheTableHasEveryMethodAndTheHandlersUseIt) {
  std::size_t found = 0;
  for (const std::string& method : all_methods()) {
    const auto rules = method_rules();
    const auto rule = std::ranges::find(rules, method, &MethodRule::name);
    ASSERT_NE(rule, rules.end()) << method << " is not in the table of rights";
    ++found;
    for (const auto& [rights, token] : {std::pair{kRead, kReader}, {kSubmit, kSubmitter}}) {
      const auto code = call_by_name(service_->channel, method, token).error_code();
      EXPECT_EQ(code == grpc::StatusCode::PERMISSION_DENIED, !rights.contains(rule->needed)) << method << token;
    }
  }
  EXPECT_EQ(found + 3, method_rules().size()) << "reflection and the live page's two are no methods of ours";
}

TEST_F(Owners, AreAskedByReflection) {
  const std::string method = "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo";
  EXPECT_EQ(call_by_name(service_->channel, method, "").error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(call_by_name(service_->channel, method, kSubmitter).error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(call_by_name(service_->channel, method, kReader).ok());
}

TEST_F(Owners, AreNotAskedByHealthChecks) {
  EXPECT_TRUE(call_by_name(service_->channel, "/grpc.health.v1.Health/Check", "").ok());
}

}  // namespace
}  // namespace varimesh::server::testing
