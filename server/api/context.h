// What all handlers share, how a caller is let in, and how a unary call is moved to the pool.
#pragma once

#include <grpcpp/grpcpp.h>

#include <utility>

#include "server/access/access.h"
#include "server/access/callers_view.h"
#include "server/access/certificate_name.h"
#include "server/access/page_tokens.h"
#include "server/addresses.h"
#include "server/api/requests.h"
#include "server/limits.h"
#include "server/meshes/mesh_store.h"
#include "server/resources/pool.h"
#include "server/scheduling/scheduler.h"
#include "server/streams/calls.h"
#include "server/streams/peer_counts.h"
#include "server/streams/status.h"

namespace varimesh::server {

/// The parts of a running server that the handlers use. All of them outlive every call.
struct ApiContext {
  Scheduler& scheduler;
  MeshStore& meshes;
  const Access& access;
  Pool& pool;
  Pool& files;  ///< For calls that read, write or hash the bytes of meshes: other calls do not wait for them.
  Pool& large;  ///< For requests of megabytes, which a thread takes a tenth of a second to parse.
  CallRegistry& calls;
  PeerCounts& watches;
  PeerCounts& uploads;
  PeerCounts& downloads;
  const Limits& limits;
  const PageTokens& pages;
  TimePoint start_time;
};

/// The key of the metadata in which the HTTP port says from where its caller calls, since its own calls come from
/// inside this process. Nobody else can guess the key.
const std::string& key_of_address();

/// The same for the name in the certificate of that caller.
const std::string& key_of_certificate();

/// Lets the caller of a method in, with the token in the call's metadata or the certificate of the connection. Every
/// handler begins with it, and sees jobs and meshes only through what it returns. Errors: those of Access::admit().
template <class Context>
Answer<CallersView> admit(const ApiContext& api, const Context& call, Method method) {
  const auto& metadata = call.client_metadata();
  const auto header = metadata.find("authorization");
  const std::string_view authorization =
      header == metadata.end() ? std::string_view() : std::string_view(header->second.data(), header->second.size());
  const auto shown = metadata.find(key_of_certificate());
  const std::string name = !api.access.names_certificates() ? ""
                           : shown == metadata.end()        ? name_in_certificate(call)
                                                            : std::string(shown->second.data(), shown->second.size());
  const auto told = metadata.find(key_of_address());
  const std::string address =
      told == metadata.end() ? peer_address(call.peer()) : std::string(told->second.data(), told->second.size());
  auto caller = api.access.admit(method, authorization, address, name);
  if (!caller) return tl::unexpected(caller.error());
  if (const auto parent = metadata.find("traceparent"); parent != metadata.end())
    caller->trace = trace_context({parent->second.data(), parent->second.size()});
  return CallersView(api.scheduler, api.meshes, std::move(*caller));
}

inline Pool& pool_of(const ApiContext& api, Method method) {
  return method == Method::DownloadMesh || method == Method::GetResult ? api.files : api.pool;
}

/// Where a message of a stream that sends a mesh is parsed and handled.
inline Pool& pool_of(const ApiContext& api, const grpc::ByteBuffer& bytes) {
  return bytes.Length() > kMostChunkMessageBytes ? api.large : api.files;
}

/// Answers a unary call with the status of `work`, which gets what the caller may see, and the request. It runs on the
/// pool because it may wait for a disk or a database. `most`: the largest request, in bytes. A request of megabytes
/// runs where only other requests of that size wait for it.
template <class Request, class Work>
grpc::ServerUnaryReactor* unary(const ApiContext& api, grpc::CallbackServerContext* call, Method method,
                                const grpc::ByteBuffer* bytes, Work work, std::size_t most = kMostRequestBytes) {
  grpc::ServerUnaryReactor* reactor = call->DefaultReactor();
  auto view = admit(api, *call, method);
  if (!view)
    reactor->Finish(status(view.error()));
  else
    (bytes->Length() > kMostRequestBytes ? api.large : api.pool)
        .post(
            [reactor, view = *view, bytes, most, work = std::move(work)] {
              const LogScope scope(view.caller().log_fields());
              reactor->Finish(guarded([&] {
                const auto request = parse<Request>(*bytes, most);
                return request ? work(view, *request) : status(request.error());
              }));
            },
            view->caller().peer);
  return reactor;
}

}  // namespace varimesh::server
