// Requests that are parsed by their handlers, when it is known who calls. gRPC by itself would parse them before any
// handler is asked: a few megabytes of fields that nobody knows take a hundred times their size.
#pragma once

#include <google/protobuf/descriptor.h>
#include <grpcpp/grpcpp.h>

#include <string>

#include "server/failure.h"
#include "server/limits.h"
#include "server/refusals.h"
#include "varimesh/v1/service.grpc.pb.h"  // and with it what generated code needs, wherever gRPC's version has that

namespace varimesh::server {

/// The largest request, in bytes, of a call that neither submits a job nor sends a mesh.
inline constexpr std::size_t kMostRequestBytes = std::size_t{64} << 10;

/// The largest message that submits a job, in bytes: as much as gRPC takes.
inline constexpr std::size_t kMostSpecBytes = std::size_t{4} << 20;

/// The most bytes of a message of a stream that sends a mesh, unless it has a spec.
inline constexpr std::size_t kMostChunkMessageBytes = kMaxChunkBytes + kMostRequestBytes;

/// Parses a message that came. INVALID_ARGUMENT if it has more than `most` bytes, or is of another type.
template <class Request>
Answer<void> parse(const grpc::ByteBuffer& bytes, Request* request, std::size_t most) {
  if (bytes.Length() > most)
    return bad_request("The request has " + std::to_string(bytes.Length()) + " bytes, but may have " +
                       std::to_string(most) + ".");
  grpc::ByteBuffer shared = bytes;  // reading takes the bytes away
  if (!grpc::SerializationTraits<Request>::Deserialize(&shared, request).ok())
    return bad_request("The request is no message of this method.");
  return {};
}
template <class Request>
Answer<Request> parse(const grpc::ByteBuffer& bytes, std::size_t most = kMostRequestBytes) {
  Answer<Request> request;
  if (const auto parsed = parse(bytes, &*request, most); !parsed) return tl::unexpected(parsed.error());
  return request;
}

/// Parses a message of a stream that sends a mesh. Beside the bytes of the mesh it may have as much as any request:
/// what nobody knows takes ten times its size, for as long as the message is kept. It is empty after a failure.
template <class Request>
Answer<void> parse_chunk(const grpc::ByteBuffer& bytes, Request* request) {
  auto parsed = parse(bytes, request, kMostChunkMessageBytes);
  if (parsed && bytes.Length() > request->chunk().data().size() + kMostRequestBytes)
    parsed = bad_request("The message has " + std::to_string(bytes.Length() - request->chunk().data().size()) +
                         " bytes beside those of the mesh, but may have " + std::to_string(kMostRequestBytes) + ".");
  if (!parsed) *request = Request();
  return parsed;
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

/// The same for a method that takes a stream.
template <class Service, class Response>
grpc::internal::MethodHandler* unparsed(Service* service, grpc::ServerReadReactor<grpc::ByteBuffer>* (Service::*handle)(
                                                              grpc::CallbackServerContext*, Response*)) {
  return new grpc::internal::CallbackClientStreamingHandler<grpc::ByteBuffer, Response>(
      [service, handle](grpc::CallbackServerContext* call, Response* response) {
        return (service->*handle)(call, response);
      });
}
/// The same for a method that takes a stream and answers with one.
template <class Service, class Response>
grpc::internal::MethodHandler* unparsed(Service* service, grpc::ServerBidiReactor<grpc::ByteBuffer, Response>* (
                                                              Service::*handle)(grpc::CallbackServerContext*)) {
  return new grpc::internal::CallbackBidiHandler<grpc::ByteBuffer, Response>(
      [service, handle](grpc::CallbackServerContext* call) { return (service->*handle)(call); });
}

}  // namespace varimesh::server
