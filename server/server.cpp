// Putting the parts together and taking them apart again.
#include "server/server.h"

#include <arpa/inet.h>
#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/grpcpp.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <atomic>
#include <cassert>
#include <charconv>
#include <random>
#include <thread>

#include "server/api/job_service.h"
#include "server/api/mesh_service.h"
#include "server/api/optimise_service.h"
#include "server/jobs/memory_job_store.h"
#include "server/jobs/sqlite_job_store.h"
#include "server/jobs/thread_budget.h"
#include "server/meshes/directory_mesh_store.h"
#include "server/operations/admin.h"
#include "server/operations/health.h"
#include "server/operations/state_directory.h"

namespace varimesh::server {
namespace {

/// Threads for disk and hashing; they wait more than they work.
constexpr int kPoolThreads = 4;

std::string random_name() {
  std::random_device device;
  constexpr char digits[] = "0123456789abcdef";
  std::string name = "jobs/";
  for (int i = 0; i < 4; ++i) {
    std::uint32_t bits = device();
    for (int j = 0; j < 4; ++j, bits >>= 4) name += digits[bits & 15];
  }
  return name;
}

/// The host of HOST:PORT or [HOST]:PORT.
std::string host_of(const std::string& address) {
  const auto colon = address.rfind(':');
  std::string host = address.substr(0, colon);
  if (host.size() > 1 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  return host;
}

/// gRPC takes a port modulo 65536, and none for 443.
bool has_port(const std::string& address) {
  if (address.rfind("unix:", 0) == 0) return true;
  const auto colon = address.rfind(':');
  if (colon == std::string::npos || colon + 1 == address.size()) return false;
  unsigned port = 0;
  const auto [end, error] = std::from_chars(address.data() + colon + 1, address.data() + address.size(), port);
  return error == std::errc{} && end == address.data() + address.size() && port <= 65535;
}

/// Calls a function a few times a second, on a thread of its own.
class Ticker {
 public:
  Ticker(std::chrono::milliseconds interval, std::function<void()> tick)
      : thread_([this, interval, tick = std::move(tick)] {
          std::unique_lock lock(mutex_);
          while (!stopped_.wait_for(lock, interval, [this] { return stopping_; })) {
            lock.unlock();
            tick();
            lock.lock();
          }
        }) {}
  ~Ticker() {
    {
      std::lock_guard lock(mutex_);
      stopping_ = true;
    }
    stopped_.notify_all();
    thread_.join();
  }

 private:
  std::mutex mutex_;
  std::condition_variable stopped_;
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace

bool is_loopback(const std::string& address) {
  if (address.rfind("unix:", 0) == 0) return true;
  const std::string host = host_of(address);
  in_addr v4{};
  in6_addr v6{};
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  if (inet_pton(AF_INET6, host.c_str(), &v6) == 1) return IN6_IS_ADDR_LOOPBACK(&v6);
  return host == "localhost";
}

// In the order in which they need each other; destroyed the other way round.
struct Server::Parts {
  explicit Parts(ServerOptions given) : options(std::move(given)), budget(options.limits.threads) {
    options.limits.threads = budget.threads();
  }

  ServerOptions options;
  ThreadBudget budget;
  std::unique_ptr<StateDirectory> state;
  std::unique_ptr<DirectoryMeshStore> meshes;
  std::unique_ptr<JobStore> jobs;
  std::unique_ptr<Scheduler> scheduler;
  CallRegistry calls;
  PeerCounts watches{options.limits.max_watches_per_peer}, uploads{options.limits.max_uploads_per_peer};
  std::unique_ptr<Pool> pool;
  std::unique_ptr<ApiContext> api;
  std::unique_ptr<HealthService> health;
  std::unique_ptr<MeshService> mesh_service;
  std::unique_ptr<JobService> job_service;
  std::unique_ptr<OptimiseService> optimise_service;
  std::unique_ptr<grpc::Server> server;
  std::unique_ptr<Watching> watching;
  std::unique_ptr<AdminServer> admin;
  std::unique_ptr<Ticker> calls_ticker;
  std::unique_ptr<Ticker> jobs_ticker;
  std::unique_ptr<Ticker> sweeper;
  std::unique_ptr<Ticker> compressor;
  std::atomic<bool> stopping = false;
  std::string address;
  int port = 0;
  bool stopped = false;

  Expected<void> open_stores();
  void assemble() {
    SchedulerSettings settings;
    settings.threads = budget.threads();
    settings.max_pending = options.limits.max_pending_jobs;
    settings.max_pending_of_owner = options.limits.max_pending_jobs_per_peer;
    settings.max_ended = options.limits.max_ended_jobs;
    settings.checkpoint_pause = options.limits.checkpoint_pause;
    settings.clock = options.clock;
    settings.has_room = [this] { return meshes->has_room(); };
    settings.new_name = options.new_name ? options.new_name : random_name;
    settings.memory = options.limits.max_memory_bytes;
    settings.launch = [this](int threads, SchedulerSettings::Job job) { budget.launch(threads, std::move(job)); };
    settings.log = [](const std::string& job, const std::string& what) { spdlog::info("{} {}", job, what); };
    scheduler = std::make_unique<Scheduler>(jobs.get(), meshes.get(), options.engine, std::move(settings));
    pool = std::make_unique<Pool>(kPoolThreads);
    api = std::make_unique<ApiContext>(
        ApiContext{*scheduler, *meshes, *pool, calls, watches, uploads, options.limits, options.clock()});
    health = std::make_unique<HealthService>(*api);
    mesh_service = std::make_unique<MeshService>(*api);
    job_service = std::make_unique<JobService>(*api);
    optimise_service = std::make_unique<OptimiseService>(*api);
  }

  Expected<void> listen();
};

Expected<void> Server::Parts::open_stores() {
  const auto output_error = [](const Failure& failure) {
    return tl::unexpected(Error{Error::Kind::Output, failure.sentence});
  };
  DirectoryMeshSettings mesh_settings;
  mesh_settings.max_mesh_bytes = options.limits.max_mesh_bytes;
  mesh_settings.max_total_bytes = options.limits.max_store_bytes;
  mesh_settings.reserve_bytes = options.limits.reserve_bytes;
  mesh_settings.lifetime = options.limits.mesh_lifetime;
  mesh_settings.compress_after = options.limits.compress_after;
  mesh_settings.log = [](const std::string& line) { spdlog::warn("{}", line); };
  JobStoreSettings job_settings;
  job_settings.clock = options.clock;
  job_settings.max_running_of_owner = options.limits.max_running_jobs_per_peer;
  if (!options.state.empty()) {
    auto taken = StateDirectory::take(options.state);
    if (!taken) return tl::unexpected(taken.error());
    state = std::move(*taken);
    auto opened = SqliteJobStore::open(state->jobs(), job_settings);
    if (!opened) return output_error(opened.error());
    jobs = std::move(*opened);
  } else {
    jobs = std::make_unique<MemoryJobStore>(job_settings);
  }
  auto opened = state != nullptr ? DirectoryMeshStore::open_directory(state->meshes(), mesh_settings)
                                 : DirectoryMeshStore::create(options.data, mesh_settings);
  if (!opened) return output_error(opened.error());
  meshes = std::move(*opened);
  return {};
}

Expected<void> Server::Parts::listen() {
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  // Two servers on one port would otherwise both start, and share the calls between them.
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  // A watcher behind a dead connection is noticed, and one that pings is not cut for it.
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 60'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 10'000);
  builder.RegisterService(health.get());
  builder.RegisterService(mesh_service.get());
  builder.RegisterService(job_service.get());
  builder.RegisterService(optimise_service.get());
  const bool socket = options.listen.rfind("unix:", 0) == 0;
  if (!options.listen.empty()) builder.AddListeningPort(options.listen, grpc::InsecureServerCredentials(), &port);

  const mode_t mask = socket ? ::umask(0177) : 0;  // a socket of the owner alone
  server = builder.BuildAndStart();
  if (socket) ::umask(mask);
  if (server == nullptr || (!options.listen.empty() && port == 0))
    return tl::unexpected(Error{Error::Kind::Output, "Cannot listen on " + options.listen +
                                                         ": the address is taken or not this machine's; name another "
                                                         "one (port 0 takes a free one)."});
  if (socket)
    address = options.listen;
  else if (!options.listen.empty())
    address = options.listen.substr(0, options.listen.rfind(':')) + ":" + std::to_string(port);
  return {};
}

Expected<std::unique_ptr<Server>> Server::start(ServerOptions options) {
  const std::string& listen = options.listen;
  if (!listen.empty() && listen.rfind("unix:", 0) != 0 && listen.rfind(':') == std::string::npos)
    return bad_option("The address '" + listen + "' has no port; write HOST:PORT or unix:PATH.");
  if (!listen.empty() && !has_port(listen))
    return bad_option("The address " + listen +
                      " has no port from 0 to 65535; give HOST:PORT, with port 0 for a free one.");
  if (!listen.empty() && !is_loopback(listen) && !options.insecure)
    return bad_option(
        "Anybody who reaches " + listen +
        " could use this server, and nothing would be encrypted; listen on 127.0.0.1, or say --insecure.");

  auto parts = std::make_unique<Parts>(std::move(options));
  if (const auto opened = parts->open_stores(); !opened) return tl::unexpected(opened.error());
  parts->assemble();
  // Before anybody can ask: what this server claims itself must not be taken back.
  if (const auto recovered = parts->scheduler->recover(); !recovered)
    return tl::unexpected(Error{Error::Kind::Output, recovered.error().sentence});
  if (!parts->options.admin.empty()) {
    parts->watching = std::make_unique<Watching>(parts->scheduler.get(), parts->options.limits, parts->options.clock);
    auto admin = AdminServer::start(parts->options.admin, parts->watching.get(),
                                    [health = parts->health.get()] { return health->serving(); });
    if (!admin) return tl::unexpected(admin.error());
    parts->admin = std::move(*admin);
  }
  if (const auto listening = parts->listen(); !listening) return tl::unexpected(listening.error());
  parts->scheduler->tick();
  parts->calls_ticker = std::make_unique<Ticker>(
      std::chrono::milliseconds(250), [calls = &parts->calls] { calls->tick(std::chrono::steady_clock::now()); });
  parts->jobs_ticker = std::make_unique<Ticker>(std::chrono::seconds(1), [parts = parts.get()] {
    parts->scheduler->tick();
    parts->health->set_serving(parts->meshes->has_room());
  });
  parts->sweeper =
      std::make_unique<Ticker>(std::chrono::minutes(1), [meshes = parts->meshes.get()] { meshes->sweep(); });
  parts->compressor = std::make_unique<Ticker>(std::chrono::minutes(1), [parts = parts.get()] {
    ::setpriority(PRIO_PROCESS, 0, 19);  // of this thread alone: it takes what the jobs leave
    if (const auto needed = parts->jobs->needed_digests())
      parts->meshes->compress_idle(*needed, [parts] { return parts->stopping.load(); });
  });
  parts->health->set_serving(parts->meshes->has_room());
  return std::unique_ptr<Server>(new Server(std::move(parts)));
}

Server::Server(std::unique_ptr<Parts> parts) : parts_(std::move(parts)) {}

Server::~Server() {
  // Jobs hold on to parts of the server: there is no going on without them, however long they take.
  while (!parts_->stopped) stop(std::chrono::hours(1));
}

const std::string& Server::address() const { return parts_->address; }
int Server::port() const { return parts_->port; }

const std::string& Server::admin_address() const {
  static const std::string none;
  return parts_->admin == nullptr ? none : parts_->admin->address();
}

std::shared_ptr<grpc::Channel> Server::in_process_channel() {
  return parts_->server->InProcessChannel(grpc::ChannelArguments());
}

bool Server::stop(std::chrono::milliseconds patience) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  parts_->stopping = true;
  parts_->jobs_ticker.reset();
  parts_->compressor.reset();
  parts_->health->set_serving(false);
  // Watchers go first, so that they hear of the server's end and not of the cancels that it makes.
  parts_->calls.end_all(stopping_status());
  parts_->scheduler->stop();
  parts_->calls.wait_empty(std::min(deadline, std::chrono::steady_clock::now() + std::chrono::seconds(5)));
  parts_->server->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(2));
  parts_->server->Wait();
  parts_->stopped = parts_->scheduler->drain(deadline);
  return parts_->stopped;
}

}  // namespace varimesh::server
