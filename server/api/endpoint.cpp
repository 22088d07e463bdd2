// Starts and stops the gRPC server.
#include "server/api/endpoint.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <grpcpp/resource_quota.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <random>

#include "server/access/reflection_guard.h"
#include "server/addresses.h"
#include "server/metrics/call_counter.h"

namespace varimesh::server {
namespace {

/// Threads that wait more than they work: for the calls that ask the job store, and for those that move files and hash.
constexpr int kPoolThreads = 4, kFileThreads = 4;
/// Threads that parse requests of megabytes. Several would take the processors from other calls.
constexpr int kLargeThreads = 1;

/// Bytes that a connection reads at once, and keeps room for while it waits.
constexpr int kReadAtOnce = 256 << 10;

/// For how long after a refused connection the server counts as full. Longer than between two calls to itself.
constexpr std::chrono::seconds kFull{15};

int in_milliseconds(std::chrono::milliseconds time) { return static_cast<int>(time.count()); }

/// Limits what a client can take without a call that the services could refuse.
void set_bounds(grpc::ServerBuilder& builder, const Limits& limits) {
  grpc::ResourceQuota quota("varimeshd");
  quota.Resize(kConnectionMemory);
  builder.SetResourceQuota(quota);
  // A message of 2 MB can expand to 2 GB before anybody looks at it. Meshes are compressed by zstd, piece by piece.
  builder.SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_GZIP, false);
  builder.SetCompressionAlgorithmSupportStatus(GRPC_COMPRESS_DEFLATE, false);
  builder.AddChannelArgument(GRPC_ARG_TCP_MAX_READ_CHUNK_SIZE, kReadAtOnce);
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, in_milliseconds(limits.handshake_timeout));
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, in_milliseconds(limits.connection_idle));
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_AGE_MS, in_milliseconds(limits.connection_age));
}

/// A key of metadata that nobody can guess.
std::string random_key(std::string key) {
  std::random_device device;
  for (int i = 0; i < 4; ++i) key += "-" + std::to_string(device());
  return key;
}

}  // namespace

const std::string& key_of_address() {
  static const std::string key = random_key("varimesh-address");
  return key;
}

const std::string& key_of_certificate() {
  // gRPC takes any bytes as the value of such a key.
  static const std::string key = random_key("varimesh-certificate") + "-bin";
  return key;
}

void keep_connections_small() {
  // gRPC 1.51 can allocate what it reads into in pieces of 64 KiB. It then looks at no limit, and an open connection
  // keeps as much as it has ever read at once: several megabytes. Other versions may not know this switch.
  if (grpc::Version().starts_with("1.51.")) ::setenv("GRPC_EXPERIMENTS", "-tcp_read_chunks", 0);
}

Endpoint::Endpoint(Scheduler& scheduler, MeshStore& meshes, const Access& access, const Limits& limits,
                   const PageTokens& pages, TimePoint start_time, Metrics* metrics)
    : watches_(limits.max_watches_per_peer),
      uploads_(limits.max_uploads_per_peer),
      downloads_(limits.max_downloads_per_peer),
      pool_(kPoolThreads),
      files_(kFileThreads),
      large_(kLargeThreads),
      context_{scheduler, meshes,   access,     pool_,  files_, large_,    calls_,
               watches_,  uploads_, downloads_, limits, pages,  start_time},
      health_(context_),
      mesh_service_(context_),
      job_service_(context_),
      optimise_service_(context_),
      metrics_(metrics) {}

Expected<void> Endpoint::listen(const std::string& address,
                                const std::shared_ptr<grpc::ServerCredentials>& credentials) {
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  // Otherwise two servers could start on the same port and would share the calls.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  // The server detects clients behind a dead connection, and accepts the pings of clients that check theirs.
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 60'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 10'000);
  set_bounds(builder, context_.limits);
  builder.RegisterService(&health_);
  builder.RegisterService(&mesh_service_);
  builder.RegisterService(&job_service_);
  builder.RegisterService(&optimise_service_);
  const bool socket = is_unix_socket(address);
  using Acceptor = grpc::experimental::ExternalConnectionAcceptor;
  std::shared_ptr<Acceptor> acceptor;
  if (socket) {
    builder.AddListeningPort(address, credentials, &port_);
  } else if (!address.empty()) {
    auto listener = TcpListener::open(address);
    if (!listener) return tl::unexpected(listener.error());
    listener_ = std::move(*listener);
    port_ = listener_->port();
    using From = grpc::ServerBuilder::experimental_type::ExternalConnectionType;
    acceptor = builder.experimental().AddExternalConnectionAcceptor(From::FROM_FD, credentials);
  }
  std::vector<InterceptorFactory> interceptors;
  if (context_.access.asks()) interceptors.push_back(reflection_guard(context_.access));
  if (metrics_ != nullptr) interceptors.push_back(call_counter(*metrics_));
  builder.experimental().SetInterceptorCreators(std::move(interceptors));

  if (socket) {
    auto lock = SocketLock::take(address);
    if (!lock) return tl::unexpected(lock.error());
    socket_lock_ = std::move(*lock);
  }
  const mode_t mask = socket ? ::umask(0177) : 0;  // only the owner may use the socket
  server_ = builder.BuildAndStart();
  if (socket) ::umask(mask);
  if (server_ == nullptr || (!address.empty() && port_ == 0))
    return tl::unexpected(
        Error{Error::Kind::Output, "Cannot listen on " + address + "; choose another address, or look into the log."});
  if (listener_ != nullptr)
    listener_->start([acceptor](int listening, int accepted, const std::string&) {
      Acceptor::NewConnectionParameters connection;
      connection.listener_fd = listening;
      connection.fd = accepted;
      acceptor->HandleNewConnection(&connection);
    });
  if (socket)
    address_ = address;
  else if (!address.empty())
    address_ = address.substr(0, address.rfind(':')) + ":" + std::to_string(port_);
  return {};
}

bool Endpoint::is_full() const { return listener_ != nullptr && listener_->turned_away(kFull); }

std::shared_ptr<grpc::Channel> Endpoint::in_process_channel() {
  return server_->InProcessChannel(grpc::ChannelArguments());
}

void Endpoint::stop(std::chrono::steady_clock::time_point deadline, const std::function<void()>& between) {
  health_.set_serving(false);
  calls_.end_all(stopping_status());
  between();
  calls_.wait_empty(std::min(deadline, std::chrono::steady_clock::now() + std::chrono::seconds(5)));
  if (listener_ != nullptr) listener_->stop();
  server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(2));
  server_->Wait();
}

}  // namespace varimesh::server
