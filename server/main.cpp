// varimeshd: serves mesh optimisation over gRPC.
//
//   varimeshd                                   on 127.0.0.1:50051
//   varimeshd --listen 127.0.0.1:0              on a free port, which it prints
//   varimeshd --listen unix:/run/varimesh.sock  on a socket that its owner alone can use
//   varimeshd --listen 0.0.0.0:50051 --insecure for anybody who can reach it
//   varimeshd --admin 127.0.0.1:9464            with health for probes and a page that watches, in a browser
//   varimeshd --state /var/lib/varimesh         keeps jobs and meshes there: the next one runs what this one did not
//   end
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

#include "core/base/nearest_word.h"
#include "core/base/version.h"
#include "server/jobs/memory_budget.h"
#include "server/operations/log.h"
#include "server/server.h"

namespace {

/// Writes the address beside the file and renames it, so that who waits for the file reads all of it.
bool write_port_file(const std::string& path, const std::string& address) {
  const std::string beside = path + ".new";
  {
    std::ofstream file(beside);
    file << address << '\n';
    if (!file.flush()) return false;
  }
  return std::rename(beside.c_str(), path.c_str()) == 0;
}

/// What is said about the first word that is no flag.
std::string about_unknown_word(const CLI::App& app) {
  const std::string word = app.remaining().front().substr(0, app.remaining().front().find('='));
  std::vector<std::string> flags;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) flags.push_back("--" + name);
  const std::string meant = varimesh::nearest_word(word, flags);
  return "there is no option '" + word + "'" +
         (meant.empty() ? "; varimeshd --help lists them." : "; did you mean '" + meant + "'?");
}

}  // namespace

int main(int argc, char** argv) {
  using namespace varimesh;
  server::ServerOptions options;
  options.listen = "127.0.0.1:50051";
  options.limits.reserve_bytes = std::int64_t{64} << 20;
  options.limits.max_memory_bytes = server::machine_memory();
  std::string port_file, log_level = "info";
  double checkpoint_seconds = 5;
  int drain_seconds = 30, mesh_lifetime_hours = 7 * 24, compress_minutes = 10;

  CLI::App app{"Serves mesh optimisation over gRPC (package varimesh.v1)."};
  app.set_version_flag("--version", std::string(version()));
  app.add_option("--listen", options.listen, "HOST:PORT or unix:PATH; port 0 takes a free one")->capture_default_str();
  app.add_option("--admin", options.admin,
                 "HOST:PORT on loopback for plain HTTP: health for probes, and a page that watches; port 0 takes a "
                 "free one");
  app.add_flag("--insecure", options.insecure, "Listen beyond loopback although nothing is encrypted or checked");
  app.add_option("--port-file", port_file, "Write the address to this file instead of standard output");
  app.add_option("--log-level", log_level, "trace, debug, info, warn, error or off")->capture_default_str();
  app.add_option("--threads", options.limits.threads, "Threads shared by the running jobs; 0: all there are")
      ->check(CLI::Range(0, 4096));
  app.add_option("--max-memory-bytes", options.limits.max_memory_bytes,
                 "Memory that the running jobs may have together: one that needs more never runs (default: nine tenths "
                 "of the machine's; 0: no limit)")
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-mesh-bytes", options.limits.max_mesh_bytes, "Largest mesh that is taken")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--max-pending-jobs", options.limits.max_pending_jobs, "Jobs that may wait")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--max-pending-jobs-per-peer", options.limits.max_pending_jobs_per_peer,
                 "Of them, those of one address (a socket counts as one); 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-running-jobs-per-peer", options.limits.max_running_jobs_per_peer,
                 "Jobs of one address that run at a time, others wait; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-watches-per-peer", options.limits.max_watches_per_peer,
                 "Watches that one address may have open; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-uploads-per-peer", options.limits.max_uploads_per_peer,
                 "Uploads that one address may have open; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--state", options.state,
                 "Directory in which jobs, meshes and results outlive the server (default: they go with it)");
  app.add_option("--data", options.data,
                 "Without --state: where to make the directory for meshes (default: TMPDIR, or /tmp)");
  app.add_option("--max-ended-jobs", options.limits.max_ended_jobs,
                 "Jobs remembered, with their results, after their end")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-store-bytes", options.limits.max_store_bytes,
                 "Beyond it the oldest meshes go that no job refers to; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--reserve-bytes", options.limits.reserve_bytes,
                 "Free space on the disk that is left for the jobs that run: below it nothing is taken")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--checkpoint-seconds", checkpoint_seconds,
                 "With --state: the state of a running job is kept after 30 s, or after ten iterations and so many "
                 "seconds")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 30.0));
  app.add_option("--mesh-lifetime", mesh_lifetime_hours, "Hours that a mesh is kept that no job refers to")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--compress-after", compress_minutes,
                 "Minutes since anybody asked for a mesh or a result after which it is compressed; 0: never")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--drain-seconds,--drain-timeout", drain_seconds,
                 "How long a job may take to end when the server stops")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ExtrasError&) {
    std::cerr << "varimeshd: " << about_unknown_word(app) << '\n';
    return 2;
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  // Blocked before any thread is made, so that this thread alone takes them.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);

  if (const auto log = server::start_log(log_level); !log) {
    std::cerr << "varimeshd: " << log.error().sentence << '\n';
    return 2;
  }
  options.engine = server::core_engine();
  options.limits.checkpoint_pause = std::chrono::milliseconds(static_cast<int>(1000 * checkpoint_seconds));
  options.limits.mesh_lifetime = std::chrono::hours(mesh_lifetime_hours);
  options.limits.compress_after = std::chrono::minutes(compress_minutes);
  if (options.state.empty()) spdlog::info("jobs and meshes go with this process; --state DIR keeps them");
  auto server = server::Server::start(std::move(options));
  if (!server) {
    std::cerr << "varimeshd: " << server.error().sentence << '\n';
    return server.error().kind == Error::Kind::BadOption ? 2 : 1;
  }
  const std::string address = (*server)->address();
  if (port_file.empty()) {
    std::cout << "varimeshd listens on " << address << std::endl;
  } else if (!write_port_file(port_file, address)) {
    std::cerr << "varimeshd: cannot write " << port_file << "; name a file in a folder that exists.\n";
    return 1;
  }
  spdlog::info("varimeshd {} listens on {}", version(), address);
  if (const std::string& admin = (*server)->admin_address(); !admin.empty())
    spdlog::info("the page that watches is http://{}/", admin);

  int signal = 0;
  sigwait(&signals, &signal);
  spdlog::info("stopping");
  if (!(*server)->stop(std::chrono::seconds(drain_seconds))) {
    // A job that does not end by itself must not keep the process: whoever sent the signal would kill it anyway. With
    // --state it waits for the next server.
    spdlog::warn("a job did not end within {} s and is left", drain_seconds);
    std::_Exit(0);
  }
  spdlog::info("stopped");
  return 0;
}
