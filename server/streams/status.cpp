// The code and the details of a status.
#include "server/streams/status.h"

#include "core/base/utf8.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace varimesh::server {
namespace {

/// The largest value in the metadata of an error, in bytes. The longest that the server itself writes is a digest.
constexpr std::size_t kMostMetadataBytes = 256;

grpc::StatusCode code(Failure::Code code) {
  switch (code) {
    case Failure::Code::InvalidArgument:
      return grpc::StatusCode::INVALID_ARGUMENT;
    case Failure::Code::Unauthenticated:
      return grpc::StatusCode::UNAUTHENTICATED;
    case Failure::Code::PermissionDenied:
      return grpc::StatusCode::PERMISSION_DENIED;
    case Failure::Code::NotFound:
      return grpc::StatusCode::NOT_FOUND;
    case Failure::Code::AlreadyExists:
      return grpc::StatusCode::ALREADY_EXISTS;
    case Failure::Code::FailedPrecondition:
      return grpc::StatusCode::FAILED_PRECONDITION;
    case Failure::Code::OutOfRange:
      return grpc::StatusCode::OUT_OF_RANGE;
    case Failure::Code::ResourceExhausted:
      return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case Failure::Code::Aborted:
      return grpc::StatusCode::ABORTED;
    case Failure::Code::DataLoss:
      return grpc::StatusCode::DATA_LOSS;
    case Failure::Code::Unavailable:
      return grpc::StatusCode::UNAVAILABLE;
    case Failure::Code::Internal:
      break;
  }
  return grpc::StatusCode::INTERNAL;
}

}  // namespace

grpc::Status status(const Failure& failure, const google::protobuf::Message* detail) {
  google::rpc::Status full;
  full.set_code(code(failure.code));
  // Every refusal passes here, and some quote what a client has sent.
  const std::string sentence = as_plain_text(failure.sentence);
  full.set_message(sentence);
  google::rpc::ErrorInfo info;
  info.set_reason(failure.reason);
  info.set_domain("varimesh");
  for (const auto& [key, value] : failure.metadata)
    (*info.mutable_metadata())[key] = as_plain_text(value, kMostMetadataBytes);
  full.add_details()->PackFrom(info);
  if (failure.retry_seconds > 0) {
    google::rpc::RetryInfo retry;
    retry.mutable_retry_delay()->set_seconds(failure.retry_seconds);
    full.add_details()->PackFrom(retry);
  }
  if (detail != nullptr) full.add_details()->PackFrom(*detail);
  return {code(failure.code), sentence, full.SerializeAsString()};
}

}  // namespace varimesh::server
