// The whole service as one object. varimeshd starts it, and the command runs it in its own process if it is used
// without --server.
#pragma once

#include <grpcpp/channel.h>

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "server/access/json_web_tokens.h"
#include "server/engine/engine.h"
#include "server/jobs/job_store.h"
#include "server/limits.h"
#include "server/meshes/mesh_place.h"
#include "server/resources/thread_budget.h"
#include "server/tls/tls.h"
#include "server/tracing/spans.h"
#include "server/webhooks/webhook_settings.h"

namespace varimesh::server {

class Access;
class AdminServer;
class Endpoint;
class Gateway;
class LastGoodFiles;
class Metrics;
class PageTokens;
class ProbeServer;
class Scheduler;
class Stores;
class SelfCheck;
class Upkeep;
class Webhooks;

/// What a server does: answer clients and run jobs, or only one of both.
enum class Role { All, Frontend, Worker };

/// Settings of a server. With the defaults it listens nowhere and uses the whole machine.
struct ServerOptions {
  std::string listen;     ///< HOST:PORT (port 0: any free port) or unix:PATH. Empty: in-process channels only.
  std::string admin;      ///< HOST:PORT on loopback for health checks and the live page. Empty: none.
  std::string http;       ///< HOST:PORT on loopback, unless `insecure`, for calls over HTTP, with JSON. Empty: none.
  std::string https;      ///< HOST:PORT for the same, encrypted with `tls`. Empty: none.
  std::string metrics;    ///< HOST:PORT for health checks and metrics, which others may reach. Empty: none.
  TlsFiles tls;           ///< Certificates. Without them nothing is encrypted.
  bool insecure = false;  ///< Allows addresses beyond loopback although everybody may call or read.
  std::string tokens;     ///< A file of tokens, which says who may call. Empty: everybody.
  JsonWebTokenSettings web_tokens;  ///< Tokens of an OpenID Connect issuer, which may be used beside those of the file.
  bool asks_for_tokens() const { return !tokens.empty() || web_tokens.are_given(); }
  std::string state;  ///< A directory of jobs and meshes that outlive the server. Empty: both are deleted with it.
  std::string data;   ///< If `state` is empty: the directory in which the temporary directory for meshes is created.
                      ///< Empty: the system's directory for temporary files.
  Limits limits;
  WebhookSettings webhooks;  ///< Whom jobs may have called at their end. Empty: nobody.
  /// Opens a job store elsewhere, such as in a database, while meshes are kept in `state`. Empty: jobs are there too.
  std::function<Expected<std::unique_ptr<JobStore>>(const JobStoreSettings&)> open_jobs;
  std::string meshes;  ///< With `open_jobs`: a directory of meshes that servers share. Empty: they are in `state`.
  std::shared_ptr<MeshPlace> mesh_place;  ///< As `meshes`, but elsewhere than in a directory.
  Role role = Role::All;                  ///< If it is not All, other servers of the same database do the rest.
  bool isolates =
      false;      ///< The engine runs each job in a process of its own, and tells when that process has crashed.
  Engine engine;  ///< Runs the jobs: core_engine(), or an engine of a test.
  std::vector<std::string> devices = {};  ///< For jobs, as CUDA_VISIBLE_DEVICES names each. Empty: jobs have none.
  int jobs_per_device = 1;                ///< Jobs that may have the same device at a time.
  std::string device_names = {};          ///< What these devices are called.
  std::function<TimePoint()> clock = std::chrono::system_clock::now;
  SpanSink spans;                         ///< Takes the spans of calls and jobs, for traces; may be empty.
  std::function<void()> lost;             ///< Called once if the server has not reached itself for `limits.watchdog`.
  std::function<std::string()> new_name;  ///< Makes the names of new jobs. Empty: random names.
};

/// A running server.
class Server {
 public:
  /// Listens and serves. Jobs that another server left in `state` are continued. Errors: BadOption for an address that
  /// the server may not listen on, or for tokens or certificates that cannot be used; Output if the address is taken or
  /// the state cannot be used.
  static Expected<std::unique_ptr<Server>> start(ServerOptions options);
  /// Calls stop() if that was not done, and waits for the running jobs.
  ~Server();

  /// The address that the server listens on, with the port that was chosen; empty if there is none.
  const std::string& address() const;
  int port() const;
  /// The address of the admin port; empty if there is none.
  const std::string& admin_address() const;
  /// The addresses of the ports for calls over HTTP, the plain one and the encrypted one; empty if there is none.
  std::string http_address() const;
  std::string https_address() const;
  /// The address of the port for metrics; empty if there is none.
  const std::string& metrics_address() const;
  /// Whether the server has reached itself lately.
  bool answers() const;
  std::shared_ptr<grpc::Channel> in_process_channel();

  /// Stops in order: answers NOT_SERVING, starts no more jobs, finishes all streams with UNAVAILABLE, and shuts down.
  /// If the job store is durable, the running jobs are left to the next server; otherwise they are cancelled. Returns
  /// false if a job has not ended after `patience`. Then the process should end at once.
  bool stop(std::chrono::milliseconds patience);

 private:
  explicit Server(ServerOptions options);
  /// As start(), but exceptions of the packages that it uses go on to the caller.
  static Expected<std::unique_ptr<Server>> start_or_throw(ServerOptions options);
  /// The steps of start(). Errors as there.
  Expected<void> read_tokens();
  Expected<void> open_stores();
  Expected<void> start_webhooks();
  Expected<void> start_scheduler();
  Expected<void> start_admin_port();
  Expected<void> start_http_port();
  Expected<void> start_metrics_port();
  bool ready() const;

  // In the order in which they use each other; they are destroyed in reverse order.
  ServerOptions options_;
  ThreadBudget threads_;
  std::unique_ptr<Metrics> metrics_;
  std::unique_ptr<Stores> stores_;
  std::unique_ptr<Webhooks> webhooks_;
  std::unique_ptr<Scheduler> scheduler_;
  std::unique_ptr<Access> access_;
  std::unique_ptr<PageTokens> pages_;
  std::unique_ptr<LastGoodFiles> tls_;  ///< Null: the server does not encrypt.
  std::unique_ptr<Endpoint> endpoint_;
  std::unique_ptr<SelfCheck> self_check_;
  std::unique_ptr<AdminServer> admin_;
  std::unique_ptr<Gateway> gateway_;
  std::unique_ptr<ProbeServer> probes_;
  std::unique_ptr<Upkeep> upkeep_;
  bool running_ = false;
};

}  // namespace varimesh::server
