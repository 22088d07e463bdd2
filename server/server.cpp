// Starts the parts of the service and stops them.
#include "server/server.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <filesystem>
#include <random>

#include "server/access/callers_view.h"
#include "server/access/page_tokens.h"
#include "server/addresses.h"
#include "server/admin/admin_server.h"
#include "server/admin/probe_server.h"
#include "server/api/endpoint.h"
#include "server/engine/work_limits.h"
#include "server/http/gateway.h"
#include "server/log/log_fields.h"
#include "server/metrics/metrics.h"
#include "server/scheduling/scheduler.h"
#include "server/state/stores.h"
#include "server/tls/last_good_files.h"
#include "server/upkeep.h"
#include "server/webhooks/webhooks.h"

namespace varimesh::server {
namespace {

/// Returns 128 random bits as text.
std::string random_text() {
  std::random_device device;
  constexpr char digits[] = "0123456789abcdef";
  std::string name;
  for (int i = 0; i < 4; ++i) {
    std::uint32_t bits = device();
    for (int j = 0; j < 4; ++j, bits >>= 4) name += digits[bits & 15];
  }
  return name;
}

std::string random_name() { return "jobs/" + random_text(); }

/// Returns the name under which a server claims jobs in a store that servers share. No other running server has it,
/// since one at a time uses a state directory; the next one on the directory does, and takes back the jobs at once.
std::string worker_name(const std::string& state) {
  char host[256] = "";
  ::gethostname(host, sizeof host - 1);
  std::error_code error;
  const std::filesystem::path path = std::filesystem::canonical(state, error);
  return std::string(host) + ":" + (error ? random_text() : path.string());
}

}  // namespace

Server::Server(ServerOptions options)
    : options_(std::move(options)), threads_(options_.limits.threads), metrics_(std::make_unique<Metrics>()) {
  // A front end reads no mesh whole: whether there is memory for a job is the workers' question.
  if (options_.role == Role::Frontend) options_.limits.max_memory_bytes = 0;
  options_.limits.threads = threads_.threads();
}

Expected<void> Server::read_tokens() {
  access_ = options_.tls.are_mutual() ? Access::with_certificates() : std::make_unique<Access>();
  if (!options_.asks_for_tokens()) return {};
  auto access = Access::with_tokens(options_.tokens, options_.web_tokens, options_.clock);
  if (!access) return tl::unexpected(access.error());
  access_ = std::move(*access);
  return {};
}

Expected<void> Server::open_stores() {
  auto opened = Stores::open({options_.state, options_.data, options_.meshes, options_.mesh_place, options_.limits,
                              options_.clock, options_.open_jobs});
  if (!opened) return tl::unexpected(opened.error());
  stores_ = std::move(*opened);
  pages_ = std::make_unique<PageTokens>(stores_->secret());
  return {};
}

Expected<void> Server::start_webhooks() {
  auto webhooks = Webhooks::start(stores_->jobs(), options_.webhooks, options_.clock,
                                  [this](CallEnd end) { metrics_->count_webhook(end); });
  if (!webhooks) return tl::unexpected(webhooks.error());
  webhooks_ = std::move(*webhooks);
  return {};
}

Expected<void> Server::start_scheduler() {
  SchedulerSettings settings;
  settings.threads = options_.role == Role::Frontend ? 0 : threads_.threads();
  if (stores_->jobs().shared()) settings.worker = worker_name(options_.state);
  if (options_.isolates) settings.worker += kIsolating;
  settings.renewal_interval = options_.limits.lease / 3;
  settings.max_pending = options_.limits.max_pending_jobs;
  settings.max_pending_of_peer = options_.limits.max_pending_jobs_per_peer;
  settings.max_ended = options_.limits.max_ended_jobs;
  settings.min_ended_age = options_.limits.min_ended_age;
  settings.max_ended_age = options_.limits.max_ended_age;
  settings.max_submissions = options_.limits.max_submissions_per_peer;
  settings.checkpoint_pause = options_.limits.checkpoint_pause;
  settings.clock = options_.clock;
  settings.has_room = [this] { return stores_->meshes().has_room(); };
  settings.new_name = options_.new_name ? options_.new_name : random_name;
  settings.memory = options_.limits.max_memory_bytes;
  settings.devices = options_.devices;
  settings.jobs_per_device = options_.jobs_per_device;
  settings.device_names = options_.device_names;
  settings.launch = [this](int threads, SchedulerSettings::Job job) { threads_.launch(threads, std::move(job)); };
  settings.log = [](const std::string& job, const std::string& what) {
    const LogScope scope({.job = job.starts_with("jobs/") ? job : ""});
    spdlog::info("{} {}", job, what);
  };
  settings.noted = [this](const v1::Job& job) {
    if (!has_ended(job.state())) return metrics_->count_submission();
    metrics_->count_end(job);
    if (job.spec().has_webhook()) webhooks_->wake();
  };
  if (webhooks_->are_taken())
    settings.check_webhook = [this](const v1::Webhook& webhook) { return webhooks_->check(webhook); };
  settings.spans = options_.spans;
  settings.kernels_worked = [this](const KernelWork& work) { metrics_->count_kernels(work.operations, work.seconds); };
  settings.lost = [this] { metrics_->count_loss(); };
  settings.max_priority = options_.limits.max_priority;
  const WorkLimits work{options_.limits.max_job_iterations, options_.limits.max_job_seconds};
  scheduler_ = std::make_unique<Scheduler>(&stores_->jobs(), &stores_->meshes(), within(work, options_.engine),
                                           std::move(settings));
  // This is done before anybody can call the server, because a job that this server has claimed itself must not be
  // taken back.
  if (const auto recovered = scheduler_->recover(); !recovered)
    return tl::unexpected(Error{Error::Kind::Output, recovered.error().sentence});
  return {};
}

Expected<void> Server::start_admin_port() {
  if (options_.admin.empty()) return {};
  auto admin = AdminServer::start(
      options_.admin, std::make_unique<LiveStatus>(scheduler_.get(), options_.limits, options_.clock),
      [this] { return ready(); },
      [this](Method method, std::string_view authorization) -> Answer<CallersView> {
        auto caller = access_->admit(method, authorization, "127.0.0.1");
        if (!caller) return tl::unexpected(caller.error());
        return CallersView(*scheduler_, stores_->meshes(), std::move(*caller));
      });
  if (!admin) return tl::unexpected(admin.error());
  admin_ = std::move(*admin);
  return {};
}

Expected<void> Server::start_http_port() {
  if (options_.http.empty() && options_.https.empty()) return {};
  auto gateway = Gateway::start(
      {options_.http, options_.https, tls_ == nullptr ? TlsFiles() : tls_->copies(), options_.insecure},
      endpoint_->in_process_channel(),
      [this](Method method, std::string_view authorization, const HttpCaller& from) -> Answer<std::string> {
        auto caller = access_->admit(method, authorization, from.address, from.certificate);
        if (!caller) return tl::unexpected(caller.error());
        return std::move(caller->peer);
      });
  if (!gateway) return tl::unexpected(gateway.error());
  gateway_ = std::move(*gateway);
  return {};
}

bool Server::ready() const { return endpoint_->health().serving() && self_check_ != nullptr && self_check_->answers(); }

Expected<void> Server::start_metrics_port() {
  if (options_.metrics.empty()) return {};
  auto probes = ProbeServer::start(
      options_.metrics, [this] { return ready(); },
      [this] {
        Gauges now;
        now.ready = ready();
        if (const auto counts = scheduler_->counts()) {
          now.pending = counts->pending;
          now.running = counts->running;
        }
        now.devices = scheduler_->devices().devices();
        now.busy_devices = scheduler_->devices().busy();
        now.jobs_on_devices = scheduler_->devices().jobs();
        now.store_bytes = stores_->meshes().stored_bytes();
        now.waiting_calls = stores_->jobs().waiting_calls().value_or(0);
        const auto oldest = scheduler_->oldest_pending();
        if (oldest && *oldest)
          now.oldest_pending_seconds = std::chrono::duration<double>(options_.clock() - **oldest).count();
        else if (now.pending == 0)
          now.oldest_pending_seconds = 0;
        return metrics_->text(now);
      });
  if (!probes) return tl::unexpected(probes.error());
  probes_ = std::move(*probes);
  return {};
}

Expected<std::unique_ptr<Server>> Server::start(ServerOptions options) {
  try {
    return start_or_throw(std::move(options));
  } catch (const std::exception& error) {
    return tl::unexpected(Error{Error::Kind::Output, std::string("The server cannot start: ") + error.what() +
                                                         "; a limit on threads or memory may be too low."});
  }
}

Expected<std::unique_ptr<Server>> Server::start_or_throw(ServerOptions options) {
  const Protection protection{options.tls.are_given(), options.tls.are_mutual(), options.asks_for_tokens(),
                              options.insecure};
  if (!options.listen.empty())
    if (const auto checked = check_listen_address(options.listen, protection); !checked)
      return tl::unexpected(checked.error());
  if (!options.https.empty())
    if (const auto checked = check_https_address(options.https, protection); !checked)
      return tl::unexpected(checked.error());
  if (const auto checked = check_tls_files(options.tls); !checked) return tl::unexpected(checked.error());

  std::unique_ptr<Server> server(new Server(std::move(options)));
  if (const TlsFiles& files = server->options_.tls; files.are_given()) {
    auto copied = LastGoodFiles::of(files);
    if (!copied) return tl::unexpected(copied.error());
    server->tls_ = std::move(*copied);
  }
  if (const auto read = server->read_tokens(); !read) return tl::unexpected(read.error());
  if (const auto opened = server->open_stores(); !opened) return tl::unexpected(opened.error());
  if (const auto started = server->start_webhooks(); !started) return tl::unexpected(started.error());
  if (const auto started = server->start_scheduler(); !started) return tl::unexpected(started.error());
  server->endpoint_ = std::make_unique<Endpoint>(*server->scheduler_, server->stores_->meshes(), *server->access_,
                                                 server->options_.limits, *server->pages_, server->options_.clock(),
                                                 server->options_.metrics.empty() ? nullptr : server->metrics_.get());
  // The port does not answer before the server does, since probes ask for what comes below.
  if (const auto listening = server->endpoint_->listen(
          server->options_.listen, server_credentials(server->tls_ == nullptr ? TlsFiles() : server->tls_->copies()));
      !listening)
    return tl::unexpected(listening.error());
  server->self_check_ = std::make_unique<SelfCheck>(server->address(), server->options_.tls.are_given());
  server->self_check_->dial();
  if (const auto started = server->start_admin_port(); !started) return tl::unexpected(started.error());
  if (const auto started = server->start_metrics_port(); !started) return tl::unexpected(started.error());
  // The last one: a server that fails to start does not end the watches of those who came meanwhile.
  if (const auto started = server->start_http_port(); !started) return tl::unexpected(started.error());
  server->upkeep_ = std::make_unique<Upkeep>(
      *server->scheduler_, *server->stores_, *server->access_, *server->endpoint_, *server->self_check_,
      server->tls_.get(), *server->webhooks_, Watchdog{server->options_.limits.watchdog, server->options_.lost});
  server->running_ = true;
  server->scheduler_->tick();
  server->endpoint_->health().set_serving(server->stores_->meshes().has_room());
  return server;
}

Server::~Server() {
  // The jobs use the parts of the server, so all of them must end first, however long that takes.
  while (running_) stop(std::chrono::hours(1));
}

const std::string& Server::address() const { return endpoint_->address(); }
int Server::port() const { return endpoint_->port(); }

const std::string& Server::admin_address() const {
  static const std::string none;
  return admin_ == nullptr ? none : admin_->address();
}

std::string Server::http_address() const { return gateway_ == nullptr ? "" : gateway_->address(); }

std::string Server::https_address() const { return gateway_ == nullptr ? "" : gateway_->encrypted_address(); }

const std::string& Server::metrics_address() const {
  static const std::string none;
  return probes_ == nullptr ? none : probes_->address();
}

bool Server::answers() const { return self_check_->answers(); }

std::shared_ptr<grpc::Channel> Server::in_process_channel() { return endpoint_->in_process_channel(); }

bool Server::stop(std::chrono::milliseconds patience) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  stores_->jobs().stop_waiting();
  upkeep_->stop_jobs();
  // The streams end first, so that watchers are told that the server stops and not that it cancels their jobs.
  // A job that has not ended at the deadline is given up with the work since its last checkpoint.
  const auto for_checkpoints = std::min<std::chrono::milliseconds>(std::chrono::seconds(10), patience / 2);
  endpoint_->stop(deadline, [&] {
    if (gateway_ != nullptr) gateway_->end_long_requests();
    scheduler_->stop(for_checkpoints);
  });
  running_ = !scheduler_->drain(deadline);
  return !running_;
}

}  // namespace varimesh::server
