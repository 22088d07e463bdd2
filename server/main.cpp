// varimeshd: serves mesh optimisation over gRPC.
//
//   varimeshd                                     on a socket that only its owner can use; prints its address
//   varimeshd --tokens tokens                     on 127.0.0.1:50051, for those who have a token
//   varimeshd --listen 127.0.0.1:0                on any free port of this machine, for all its users
//   varimeshd --listen 0.0.0.0:50051 --tls-certificate server.pem --tls-key server-key.pem --tokens tokens
//                                                 for those in the network who have a token
//   varimeshd --listen 0.0.0.0:50051 --insecure   for anybody who can reach this address
//   varimeshd --admin 127.0.0.1:9464              with health checks and a page that shows the jobs, for a browser
//   varimeshd --state /var/lib/varimesh           keeps jobs and meshes there; the next server continues the jobs
//   varimeshd check --state /var/lib/varimesh     compares everything that is kept with its digests
//   varimeshd backup --state /var/lib/varimesh /backup/varimesh
//   varimeshd migrate --store postgresql://farm@db/varimesh    makes the tables of a database for the jobs
//   varimeshd --state state --store postgresql://…             keeps the jobs there
//   varimeshd --state state --store postgresql://… --meshes /shared --role worker     runs jobs, beside other servers
#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include "core/base/io/write_all.h"
#include "core/base/machine_memory.h"
#include "core/base/version.h"
#include "server/addresses.h"
#include "server/api/endpoint.h"
#include "server/command_line/flags.h"
#include "server/fetch/fetch.h"
#include "server/fetch/post.h"
#include "server/isolation/devices/devices.h"
#include "server/isolation/process_engine.h"
#include "server/log/log.h"
#include "server/maintenance/commands.h"
#include "server/meshes/disk.h"
#include "server/meshes/s3/bucket.h"
#include "server/notify.h"
#include "server/postgres/database.h"
#include "server/resources/descriptors.h"
#include "server/server.h"
#include "server/state/default_address.h"
#include "server/tls/private_file.h"
#include "server/tracing/exporter.h"

namespace {

using varimesh::server::Flags;
using varimesh::server::notify_manager;
using varimesh::server::Server;
using varimesh::server::ServerOptions;

/// Blocks SIGTERM, SIGINT and SIGHUP, so that only sigwait() receives them. Called before any thread is started, since
/// threads inherit the blocked signals. SIGHUP stays ignored if nohup or another program has it ignored.
sigset_t block_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  struct sigaction before {};
  if (sigaction(SIGHUP, nullptr, &before) == 0 && before.sa_handler != SIG_IGN) sigaddset(&signals, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  return signals;
}

/// Writes the address to a file beside `path` and renames it, so that a program that waits for `path` reads all of it.
/// Another user who may write in the folder cannot guess the name of that file, and no link is followed.
bool write_port_file(const std::string& path, const std::string& address) {
  const std::string beside = path + ".part-" + varimesh::server::random_name();
  const int file = ::open(beside.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0666);
  if (file < 0) return false;
  const bool written = varimesh::write_all(file, address + "\n");
  ::close(file);
  if (written && std::rename(beside.c_str(), path.c_str()) == 0) return true;
  ::unlink(beside.c_str());
  return false;
}

/// Tells the address of the server. Returns false, after a message, if the port file cannot be written.
bool announce(const Server& server, const std::string& port_file) {
  const std::string address = server.address();
  if (address.empty()) {
    std::cout << "varimeshd runs jobs" << std::endl;
  } else if (port_file.empty()) {
    std::cout << "varimeshd listens on " << address << std::endl;
  } else if (!write_port_file(port_file, address)) {
    std::cerr << "varimeshd: cannot write " << port_file << "; choose a file in a folder that exists.\n";
    return false;
  }
  if (address.empty())
    spdlog::info("varimeshd {} runs jobs and answers no clients", varimesh::version());
  else
    spdlog::info("varimeshd {} listens on {}", varimesh::version(), address);
  if (const std::string& admin = server.admin_address(); !admin.empty())
    spdlog::info("the live page is at http://{}/", admin);
  if (const std::string http = server.http_address(); !http.empty())
    spdlog::info("calls over HTTP are answered at http://{0}/v1/, and a page for browsers is at http://{0}/", http);
  if (const std::string https = server.https_address(); !https.empty())
    spdlog::info("calls over HTTP are answered at https://{0}/v1/, and a page for browsers is at https://{0}/", https);
  if (const std::string& metrics = server.metrics_address(); !metrics.empty())
    spdlog::info("the metrics are at http://{}/metrics", metrics);
  return true;
}

/// Sets the address if the user gave none.
varimesh::Expected<void> choose_address(ServerOptions& options) {
  if (!options.listen.empty() || options.role == varimesh::server::Role::Worker) return {};
  options.listen = "127.0.0.1:50051";
  if (options.asks_for_tokens() || options.tls.are_given()) return {};
  const auto socket = varimesh::server::private_socket(options.state);
  if (!socket) return tl::unexpected(socket.error());
  options.listen = *socket;
  return {};
}

/// Whether all users of this machine, and nobody else, can use the server.
bool is_for_this_machine(const ServerOptions& options) {
  return varimesh::server::is_loopback(options.listen) && !varimesh::server::is_unix_socket(options.listen) &&
         !options.tls.are_mutual() && !options.asks_for_tokens();
}

/// Says who beyond this machine may use an address of the server if that is more people than the user may think; empty:
/// nobody.
std::string warning_about(const std::string& address, bool encrypts, const ServerOptions& options) {
  if (address.empty() || varimesh::server::is_loopback(address)) return {};
  const bool knows_callers = options.tls.are_mutual() || options.asks_for_tokens();
  const std::string who = "everybody who can reach " + address + " can ";
  if (!encrypts && knows_callers) return who + "read and change what its clients send, their tokens too";
  if (!encrypts) return who + "use this server, and read and change what its clients send";
  return knows_callers ? "" : who + "use this server";
}

/// The same for all addresses.
std::vector<std::string> warnings_about(const ServerOptions& options) {
  return {warning_about(options.listen, options.tls.are_given(), options), warning_about(options.http, false, options),
          warning_about(options.https, true, options)};
}

/// Makes or updates the tables of the database. Returns the exit status.
int migrate(const std::string& store) {
  const auto checked = varimesh::server::check_postgres(store);
  const auto done = checked ? varimesh::server::migrate_postgres(store) : tl::unexpected(checked.error());
  if (!done) {
    std::cerr << "varimeshd: " << done.error().sentence << '\n';
    return done.error().kind == varimesh::Error::Kind::BadOption ? 2 : 1;
  }
  std::cout << *done << '\n';
  return 0;
}

/// Makes the server keep its jobs in the database. Returns false, after a message, if the address cannot be used.
bool use_database(varimesh::server::ServerOptions& options, const std::string& store) {
  if (store.empty() && (!options.meshes.empty() || options.role != varimesh::server::Role::All)) {
    std::cerr
        << "varimeshd: servers share meshes and work through a database; add --store URL, or leave out --meshes and "
           "--role.\n";
    return false;
  }
  if (options.meshes.empty() && options.role != varimesh::server::Role::All) {
    std::cerr << "varimeshd: a server that only answers clients or only runs jobs shares its meshes with others; add "
                 "--meshes DIR.\n";
    return false;
  }
  if (options.role == varimesh::server::Role::Worker && !options.listen.empty()) {
    std::cerr << "varimeshd: a worker answers no clients; leave out --listen, or --role worker.\n";
    return false;
  }
  if (store.empty()) return true;
  if (varimesh::server::is_s3(options.meshes)) {
    const varimesh::server::BucketSettings settings{options.limits.max_cache_bytes,
                                                    options.role != varimesh::server::Role::Frontend,
                                                    [](const std::string& line) { spdlog::warn("{}", line); }};
    auto bucket = varimesh::server::mesh_bucket(options.meshes, settings);
    if (!bucket) {
      std::cerr << "varimeshd: " << bucket.error().sentence << '\n';
      return false;
    }
    options.mesh_place = std::move(*bucket);
    options.meshes.clear();
  }
  if (const auto checked = varimesh::server::check_postgres(store); !checked) {
    std::cerr << "varimeshd: " << checked.error().sentence << '\n';
    return false;
  }
  if (options.state.empty()) {
    std::cerr << "varimeshd: --store keeps jobs, but their meshes and results need a directory; add --state DIR.\n";
    return false;
  }
  options.open_jobs = [store](const varimesh::server::JobStoreSettings& settings) {
    return varimesh::server::open_postgres(store, settings, [](const std::string& line) { spdlog::warn("{}", line); });
  };
  return true;
}

/// What runs the jobs.
varimesh::Expected<varimesh::server::Engine> engine_for(const Flags& flags) {
  if (!flags.runs_in_processes) return varimesh::server::core_engine();
  const std::string program = varimesh::server::find_worker();
  if (program.empty())
    return varimesh::bad_option(
        "jobs cannot run in processes of their own, because varimesh_worker is neither beside varimeshd, nor in "
        "../lib/varimesh, nor named by VARIMESH_WORKER; install it, or add --isolation none.");
  return varimesh::server::process_engine({.program = program,
                                           .threads = flags.options.limits.threads,
                                           .warn = [](const std::string& line) { spdlog::warn("{}", line); }});
}

/// Gives jobs the devices that the user wants them to have, after each was opened once.
varimesh::Expected<void> give_devices(Flags& flags) {
  if (flags.devices == 0) return {};
  if (!flags.runs_in_processes)
    return varimesh::bad_option(
        "--devices needs jobs in processes of their own, because a card that fails takes its process along; leave out "
        "--isolation none.");
  if (flags.options.role == varimesh::server::Role::Frontend)
    return varimesh::bad_option(
        "a front end runs no jobs, so it has no devices for them; give --devices to the workers.");
  auto names = varimesh::server::names_of_devices(flags.devices, std::getenv("CUDA_VISIBLE_DEVICES"));
  if (!names) return tl::unexpected(names.error());
  auto cards = varimesh::server::try_devices(varimesh::server::find_worker(), *names);
  if (!cards) return tl::unexpected(cards.error());
  spdlog::info("jobs may have {} device(s): {}", names->size(), *cards);
  flags.options.devices = std::move(*names);
  flags.options.device_names = std::move(*cards);
  return {};
}

/// The headers for the collector: those of the environment, and those of the file of --traces-headers.
varimesh::Expected<std::string> headers_for_traces(const std::string& file) {
  const char* const given = std::getenv("OTEL_EXPORTER_OTLP_HEADERS");
  std::string headers = given == nullptr ? "" : given;
  if (file.empty()) return headers;
  if (auto checked = varimesh::server::check_file_is_private("--traces-headers", file); !checked)
    return tl::unexpected(checked.error());
  std::ifstream stream(file);
  for (std::string line; std::getline(stream, line);) headers += "," + line;
  if (!stream.eof()) return varimesh::server::unusable("--traces-headers", file, "it cannot be read");
  return headers;
}

/// Makes the server send what its work takes to a collector, if the user wants it.
varimesh::Expected<void> send_traces(Flags& flags) {
  if (flags.traces.empty()) return {};
  char host[256] = "";
  ::gethostname(host, sizeof host - 1);
  auto headers = headers_for_traces(flags.traces_headers);
  if (!headers) return tl::unexpected(headers.error());
  constexpr const char* kRoles[] = {"all", "frontend", "worker"};
  auto sink = varimesh::server::export_spans(
      {.url = flags.traces,
       .headers = std::move(*headers),
       .resource = {{"service.name", "varimeshd"},
                    {"service.version", std::string(varimesh::version())},
                    {"service.instance.id", std::string(host) + ":" + std::to_string(::getpid())},
                    {"host.name", host},
                    {"varimesh.role", kRoles[static_cast<int>(flags.options.role)]}},
       .log = [](const std::string& line) { spdlog::warn("{}", line); }});
  if (!sink) return tl::unexpected(sink.error());
  flags.options.spans = std::move(*sink);
  return {};
}

/// Whether the server stops because it does not reach itself any more.
std::atomic<bool> is_lost = false;

/// Waits for a signal and stops the server. Returns the exit status.
int wait_and_stop(Server& server, const sigset_t& signals, int drain_seconds) {
  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("stopping");
  notify_manager("STOPPING=1");
  if (!server.stop(std::chrono::seconds(drain_seconds))) {
    // A job that does not end must not keep the process alive: whoever sent the signal would kill it anyway. With
    // --state the job waits for the next server.
    spdlog::warn("a job did not end within {} s and was abandoned", drain_seconds);
    std::_Exit(is_lost ? 1 : 0);
  }
  spdlog::info("stopped");
  return is_lost ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  // Other programs of this user can neither trace this process nor read its memory and environment, which have secrets.
  prctl(PR_SET_DUMPABLE, 0, 0, 0, 0);
  varimesh::return_large_blocks();
  varimesh::server::keep_connections_small();
  if (const auto status = varimesh::server::run_command(argc, argv)) return *status;
  int exit_status = 0;
  auto flags = varimesh::server::parse_flags(argc, argv, &exit_status);
  if (!flags) return exit_status;
  if (flags->migrate) return migrate(flags->store);
  const sigset_t signals = block_signals();
  const long descriptors = varimesh::server::raise_descriptor_limit();
  if (const auto log = varimesh::server::start_log(flags->log_level, flags->log_format); !log) {
    std::cerr << "varimeshd: " << log.error().sentence << '\n';
    return 2;
  }
  spdlog::debug("this process may have {} descriptors open", descriptors);

  if (!use_database(flags->options, flags->store)) return 2;
  if (const auto address = choose_address(flags->options); !address) {
    std::cerr << "varimeshd: " << address.error().sentence << '\n';
    return address.error().kind == varimesh::Error::Kind::BadOption ? 2 : 1;
  }
  flags->options.isolates = flags->runs_in_processes;
  if (varimesh::server::can_fetch()) flags->options.web_tokens.fetch = varimesh::server::fetch;
  flags->options.webhooks.post = varimesh::server::post;
  auto engine = engine_for(*flags);
  const auto prepared = engine ? give_devices(*flags) : tl::unexpected(engine.error());
  if (!prepared) {
    std::cerr << "varimeshd: " << prepared.error().sentence << '\n';
    return 2;
  }
  flags->options.engine = std::move(*engine);
  if (const auto traced = send_traces(*flags); !traced) {
    std::cerr << "varimeshd: " << traced.error().sentence << '\n';
    return 2;
  }
  flags->options.lost = [] {
    is_lost = true;
    ::kill(::getpid(), SIGTERM);
  };
  const std::vector<std::string> warnings = warnings_about(flags->options);
  const bool keeps_jobs = !flags->options.state.empty(), has_neighbours = is_for_this_machine(flags->options);
  auto server = Server::start(std::move(flags->options));
  if (!server) {
    std::cerr << "varimeshd: " << server.error().sentence << '\n';
    return server.error().kind == varimesh::Error::Kind::BadOption ? 2 : 1;
  }
  for (const std::string& warning : warnings)
    if (!warning.empty()) std::cerr << "varimeshd: WARNING: " << warning << std::endl;
  if (has_neighbours)
    spdlog::warn("every user of this machine can use this server; --tokens or a unix socket keep them out");
  if (!keeps_jobs) spdlog::info("jobs and meshes are deleted when this process ends; --state DIR keeps them");
  if (!announce(**server, flags->port_file)) return 1;

  notify_manager("READY=1\nSTATUS=Listens on " + (*server)->address() + "\n");
  return wait_and_stop(**server, signals, flags->drain_seconds);
}
