// Requests that are parsed by their handlers, when it is known who calls. gRPC by itself would parse them before any
// handler is asked: a few megabytes of fields that nobody knows take a hundred times their size.
#pragma once

#include <google/protobuf/descriptor.h>
#include <grpcpp/grpcpp.h>

#include <string>

#include "server/failure.h"
#include "server/refusals.h"
#include "varimesh/v1/service.grpc.pb.h"  // and with it what generated code needs, wherever gRPC's version has that

namespace varimesh::server {

/// The largest request, in bytes, of a call that neither submits a job nor sends a mesh.
inline constexpr std::size_t kMostRequestBytes = std::size_t{64} << 10;

/// Parses a request. INVALID_ARGUMENT if it has more than `most` bytes, or is no message of this type.
template <class Request>
Answer<Request> parse(const grpc::ByteBuffer& bytes, std::size_t most = kMostRequestBytes) {
  if (bytes.Length() > most)
    return bad_request("The request has " + std::to_string(bytes.Length()) + " bytes, but may have " +
                       std::to_string(most) + ".");
  grpc::ByteBuffer shared = bytes;  // reading takes the bytes away
  Answer<Request> request;
  if (!grpc::SerializationTraits<Request>::Deserialize(&shared, &*request).ok())
    return bad_request("The request is no message of this method.");
  return request;
}

/// The place of a method in its service, as gRPC counts them.
/// @param method  "varimesh.v1.JobService.GetJob"
inline int index_of(const char* method) {
  return google::protobuf::DescriptorPool::generated_pool()->FindMethodByName(method)->index();
}

/// A method that answers once, for grpc::Service::MarkMethodRawCallback().
template <class Service, class Response>
grpc::internal::MethodHandler* unparsed(Service* service,
                                        grpc::ServerUnaryReactor* (Service::*handle)(grpc::CallbackServerContext*,
                                                                                     const grpc::ByteBuffer*,
                                                                                     Response*)) {
  return new grpc::internal::CallbackUnaryHandler<grpc::ByteBuffer, Response>(
      [service, handle](grpc::CallbackServerContext* call, const grpc::ByteBuffer* request, Response* response) {
        return (service->*handle)(call, request, response);
      });
}
/// The same for a method that answers with a stream.
template <class Service, class Response>
grpc::internal::MethodHandler* unparsed(Service* service, grpc::ServerWriteReactor<Response>* (Service::*handle)(
                                                              grpc::CallbackServerContext*, const grpc::ByteBuffer*)) {
  return new grpc::internal::CallbackServerStreamingHandler<grpc::ByteBuffer, Response>(
      [service, handle](grpc::CallbackServerContext* call, const grpc::ByteBuffer* request) {
        return (service->*handle)(call, request);
      });
}

}  // namespace varimesh::server
