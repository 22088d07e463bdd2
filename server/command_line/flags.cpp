// The flags of varimeshd, with their ranges, defaults and help.
#include "server/command_line/flags.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <utility>
#include <vector>

#include "core/base/machine_memory.h"
#include "core/base/version.h"
#include "core/options/nearest_word.h"
#include "server/command_line/configuration.h"
#include "server/command_line/help.h"
#include "server/command_line/token_command.h"
#include "server/maintenance/commands.h"

namespace varimesh::server {
namespace {

/// Flags whose units differ from those of the field that they set.
struct Units {
  double checkpoint_seconds = 5;
  int mesh_lifetime_hours = 7 * 24;
  int compress_minutes = 10;
  int ended_minutes = 60;
  int most_ended_hours = 0;
  double lease_seconds = 30;
  double watchdog_seconds = 45;
};

void add_connection_flags(CLI::App& app, Flags& flags) {
  ServerOptions& options = flags.options;
  app.add_option("--listen", options.listen,
                 "HOST:PORT or unix:PATH; port 0 is any free port (default: 127.0.0.1:50051 with --tokens or TLS; "
                 "otherwise a unix socket that only its owner can use, in the directory of --state if it is given)");
  app.add_option("--admin", options.admin,
                 "HOST:PORT on loopback for plain HTTP: health checks, and a page that shows the jobs; port 0 is any "
                 "free port");
  app.add_option(
      "--http", options.http,
      "HOST:PORT on loopback for HTTP and JSON: the calls of gRPC for programs without it; port 0 is any free "
      "port");
  app.add_option("--metrics", options.metrics,
                 "HOST:PORT for plain HTTP that others may reach: metrics for Prometheus, and health checks; port 0 is "
                 "any free port");
  app.add_option("--traces", flags.traces,
                 "http://HOST:PORT or https://HOST:PORT of a collector of traces (OTLP over HTTP), which is told what "
                 "submitting, waiting for and running a job took");
  app.add_option("--traces-headers", flags.traces_headers,
                 "File with a key for that collector, which only this user can read: KEY=VALUE, one a line "
                 "(OTEL_EXPORTER_OTLP_HEADERS may have it as well)");
  app.add_option(
         "--tokens", options.tokens,
         "File of the tokens that callers need, one line each, as 'varimeshd token' writes it; it is read again "
         "when it changes (default: the environment variable VARIMESH_TOKENS; without it, everybody may do "
         "everything)")
      ->envname("VARIMESH_TOKENS");
  app.add_option(
      "--jwt-keys", options.web_tokens.keys,
      "Public keys of an OpenID Connect issuer (a JSON Web Key Set), whose tokens are accepted: a file, which is read "
      "again when it changes, or an address with https:// (default: the configuration of --jwt-issuer names them)");
  app.add_option("--jwt-authority", options.web_tokens.authority,
                 "File with the authority of the server that keys are fetched from, in PEM (default: those that the "
                 "machine knows)");
  app.add_option("--jwt-issuer", options.web_tokens.issuer, "The claim iss of the issuer's tokens");
  app.add_option("--jwt-audience", options.web_tokens.audience,
                 "What the claim aud of the issuer's tokens must be or contain");
  app.add_option("--jwt-owner-claim", options.web_tokens.owner_claim, "The claim that says whose a token is")
      ->capture_default_str();
  app.add_option("--jwt-roles-claim", options.web_tokens.roles_claim,
                 "The claim with the roles (submit, read, cancel, admin), as a list or with spaces between them")
      ->capture_default_str();
  app.add_option("--tls-certificate", options.tls.certificate,
                 "File with the server's certificate and those that lead to its authority, in PEM: connections are "
                 "encrypted. The files of the three flags are read again when they change");
  app.add_option("--tls-key", options.tls.key, "File with the private key of the certificate, in PEM");
  app.add_option(
      "--tls-authority", options.tls.authority,
      "File with the authority whose certificates clients must have, in PEM. Without --tokens, jobs belong to "
      "the common name in the client's certificate");
  app.add_flag("--insecure", options.insecure,
               "Allow --listen beyond loopback although everybody may call, or nothing is encrypted");
  app.add_option("--port-file", flags.port_file, "Write the address to this file instead of standard output");
  app.add_option("--log-format", flags.log_format, "text, or json: one object a line")->capture_default_str();
  app.add_option("--log-level", flags.log_level, "trace, debug, info, warn, error or off")->capture_default_str();
}

void add_resource_flags(CLI::App& app, Flags& flags) {
  Limits& limits = flags.options.limits;
  app.add_option("--isolation", flags.runs_in_processes,
                 "'process' runs each job in a process of its own, without files and network, which may crash without "
                 "harm to others; 'none' runs all jobs in the server's process")
      ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"process", true}, {"none", false}}))
      ->default_str(flags.runs_in_processes ? "process" : "none");
  app.add_option("--threads", limits.threads, "Threads shared by the running jobs; 0: all threads of the machine")
      ->check(CLI::Range(0, 4096));
  app.add_option("--max-memory-bytes", limits.max_memory_bytes,
                 "Memory that all running jobs may use together; a job that needs more fails (default: nine tenths of "
                 "the machine's; 0: no limit)")
      ->check(CLI::NonNegativeNumber);
}

void add_queue_flags(CLI::App& app, Limits& limits) {
  app.add_option("--max-mesh-bytes", limits.max_mesh_bytes, "Size of the largest mesh that the server accepts")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--max-pending-jobs", limits.max_pending_jobs, "Jobs that may wait")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--max-job-iterations", limits.max_job_iterations,
                 "Iterations of a job; a job that asks for more is refused")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  app.add_option(
         "--max-job-seconds", limits.max_job_seconds,
         "Seconds that a job runs; a job that asks for more is refused, and one without a time limit has this one")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 1e9));
  app.add_option("--max-priority", limits.max_priority,
                 "The highest priority of a job; a higher one is refused. Owners with the role admin may ask for 100")
      ->capture_default_str()
      ->check(CLI::Range(-100, 100));
  app.add_option("--max-pending-jobs-per-peer", limits.max_pending_jobs_per_peer,
                 "Jobs of one peer (the owner of the token or certificate, or the address) that may wait; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-running-jobs-per-peer", limits.max_running_jobs_per_peer,
                 "Jobs of one peer that run at a time, while its other jobs wait; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-submissions-per-peer", limits.max_submissions_per_peer,
                 "Jobs that one peer may submit in a minute; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-downloads-per-peer", limits.max_downloads_per_peer,
                 "Downloads of meshes and results that one peer may have open; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-bytes-per-owner", limits.max_bytes_per_owner,
                 "Size of all meshes and results of an owner; an owner who has more can neither upload nor submit. "
                 "0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-watches-per-peer", limits.max_watches_per_peer,
                 "Watches that one peer may have open; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--max-uploads-per-peer", limits.max_uploads_per_peer,
                 "Uploads that one peer may have open; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
}

void add_state_flags(CLI::App& app, ServerOptions& options, Units& units) {
  Limits& limits = options.limits;
  app.add_option("--state", options.state,
                 "Directory for jobs, meshes and results that outlive the server (default: the environment variable "
                 "VARIMESH_STATE; without it they are deleted when the server ends)")
      ->envname("VARIMESH_STATE");
  app.add_option("--data", options.data,
                 "Without --state: directory in which the temporary directory for meshes is created (default: TMPDIR, "
                 "or /tmp)");
  app.add_option(
         "--max-ended-jobs", limits.max_ended_jobs,
         "Jobs of an owner that are remembered, with their results, after their end; more are deleted when they "
         "are old enough")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--min-ended-age", units.ended_minutes,
                 "Minutes for which every ended job is remembered, however many there are")
      ->capture_default_str()
      ->check(CLI::Range(0, 60 * 24 * 36500));  // a century; more nanoseconds would overflow
  app.add_option("--max-ended-age", units.most_ended_hours,
                 "Hours after which every ended job is deleted, with its result; 0: no limit")
      ->capture_default_str()
      ->check(CLI::Range(0, 24 * 36500));
  app.add_option("--max-store-bytes", limits.max_store_bytes,
                 "Delete the oldest meshes that no job refers to when the store is larger than this; 0: no limit")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--reserve-bytes", limits.reserve_bytes,
                 "Disk space kept free for the running jobs; with less, the server accepts no meshes and no jobs")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--checkpoint-seconds", units.checkpoint_seconds,
                 "With --state: the state of a running job is saved after 30 s, or after ten iterations and this many "
                 "seconds")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 30.0));
  app.add_option("--mesh-lifetime", units.mesh_lifetime_hours, "Hours that a mesh is kept that no job refers to")
      ->capture_default_str()
      ->check(CLI::Range(1, 24 * 36500));  // a century; more nanoseconds would overflow
  app.add_option("--compress-after", units.compress_minutes,
                 "Minutes without a request after which a mesh or a result is compressed; 0: never")
      ->capture_default_str()
      ->check(CLI::Range(0, 60 * 24 * 36500));
}

void add_database_flags(CLI::App& app, Flags& flags, Units& units) {
  const char* const name = "--store";
  const auto add = [&](CLI::App& to, const char* what) {
    return to.add_option(name, flags.store, what)->envname("VARIMESH_STORE");
  };
  add(app,
      "With --state: address of a PostgreSQL database for the jobs, postgresql://USER@HOST/DATABASE; the state "
      "directory "
      "then keeps only meshes and results. The password comes from the file that PGPASSFILE names, or from PGPASSWORD "
      "(default: the environment variable VARIMESH_STORE; without it the jobs are in the state directory)");
  app.add_option(
         "--lease-seconds", units.lease_seconds,
         "With --store: seconds without a sign of life after which a server's running jobs go back to the queue")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 3600.0));
  app.add_option("--meshes", flags.options.meshes,
                 "With --store: directory of meshes and results that all servers of the database share, or a bucket: "
                 "s3://BUCKET/PREFIX?endpoint=URL&region=NAME, with the credentials in AWS_ACCESS_KEY_ID and "
                 "AWS_SECRET_ACCESS_KEY or in a file that AWS_SHARED_CREDENTIALS_FILE names (default: a folder of "
                 "--state, and one server)")
      ->envname("VARIMESH_MESHES");
  app.add_option("--max-cache-bytes", flags.options.limits.max_cache_bytes,
                 "With a bucket as --meshes: size of the copies of meshes in the directory of --state")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  app.add_option("--role", flags.options.role,
                 "With --store and --meshes: 'frontend' answers clients, 'worker' runs jobs, 'all' does both")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, Role>{{"all", Role::All}, {"frontend", Role::Frontend}, {"worker", Role::Worker}}))
      ->default_str("all");
  CLI::App* const migrate =
      app.add_subcommand("migrate", "Make the tables of the database of --store, or update them, and end");
  add(*migrate, "Address of the database, as for the server")->required();
  migrate->callback([&flags] { flags.migrate = true; });
}

/// Returns the message about the first word that is not a flag of the program or its subcommand.
std::string message_about_unknown_word(const CLI::App& app) {
  const std::string first = app.remaining(true).front();
  const std::string word = first.substr(0, first.find('='));
  const bool is_option = word.starts_with("-");
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  if (!is_option)
    for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  const std::string meant = varimesh::nearest_word(word, names);
  return std::string("there is no ") + (is_option ? "option '" : "subcommand '") + word + "'" +
         (meant.empty() ? "; varimeshd --help lists all options." : "; did you mean '" + meant + "'?");
}

/// The options of the program, and where their values go.
struct Program {
  explicit Program(int* exit_status) {
    Limits& limits = flags.options.limits;
    limits.reserve_bytes = std::int64_t{64} << 20;
    limits.max_memory_bytes = machine_memory();
    limits.max_job_iterations = 100'000;
    limits.max_job_seconds = 7 * 24 * 3600;
    limits.max_priority = 100;

    describe_commands(app);
    app.set_help_flag("-h,--help", "Print this help and exit");
    app.set_version_flag("--version", std::string(version()), "Print the version and exit");
    app.add_option(
        "--config", config,
        "File with settings, one 'key = value' each, with the names of these options without dashes. Options "
        "and the environment variables VARIMESHD_KEY (such as VARIMESHD_MAX_PRIORITY) go before the file "
        "(default: the environment variable VARIMESHD_CONFIG)");
    app.add_flag("--print-config", print_config, "Print all settings, with where they come from, and end");
    put_under(app, "Help and settings");
    add_connection_flags(app, flags);
    put_under(app, "Addresses, callers and the log");
    app.add_option("--watchdog-seconds", units.watchdog_seconds,
                   "Seconds without an answer to the server's own calls after which it ends with status 1, for whoever "
                   "starts it again; 0: never")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 86400.0));
    add_resource_flags(app, flags);
    put_under(app, "Running jobs");
    add_queue_flags(app, limits);
    put_under(app, "Limits of jobs and callers");
    add_state_flags(app, flags.options, units);
    put_under(app, "What is kept, and for how long");
    add_database_flags(app, flags, units);
    put_under(app, "Several servers with one database");
    app.add_option("--drain-seconds,--drain-timeout", flags.drain_seconds,
                   "Seconds that the running jobs may take to end when the server stops")
        ->capture_default_str()
        ->check(CLI::NonNegativeNumber);
    put_under(app, "Running jobs");
    token_command = &add_token_command(app, exit_status);
    add_help(app);
    let_later_values_win(app);
  }

  void parse(std::vector<std::string> words) {
    std::ranges::reverse(words);  // as CLI11 wants them
    app.parse(std::move(words));
  }
  /// Converts the values with other units.
  void finish() {
    Limits& limits = flags.options.limits;
    limits.checkpoint_pause = std::chrono::milliseconds(static_cast<int>(1000 * units.checkpoint_seconds));
    limits.watchdog = std::chrono::milliseconds(static_cast<int>(1000 * units.watchdog_seconds));
    limits.lease = std::chrono::milliseconds(static_cast<int>(1000 * units.lease_seconds));
    limits.mesh_lifetime = std::chrono::hours(units.mesh_lifetime_hours);
    limits.min_ended_age = std::chrono::minutes(units.ended_minutes);
    limits.max_ended_age = std::chrono::hours(units.most_ended_hours);
    limits.compress_after = std::chrono::minutes(units.compress_minutes);
  }

  Flags flags;
  Units units;
  CLI::App app{"Serves mesh optimisation over gRPC (package varimesh.v1)."};
  std::string config;
  bool print_config = false;
  CLI::App* token_command = nullptr;
};

/// Why these settings cannot be used without any others; empty: they can.
std::string fault_of(const std::vector<std::string>& words) {
  int ignored = 0;
  Program program(&ignored);
  try {
    program.parse(words);
  } catch (const CLI::ParseError& error) {
    return error.what();
  }
  return {};
}

/// Gathers the settings of the file and the environment, and checks each of both. Prints what is wrong with them.
std::optional<GivenSettings> gather(const CLI::App& app, int argc, char** argv) {
  auto given = gather_settings(app, argc, argv);
  if (!given) {
    std::cerr << "varimeshd: " << given.error().sentence << '\n';
    return std::nullopt;
  }
  for (const auto& [where, words] : {std::pair{"In the configuration file '" + given->file + "': ", &given->from_file},
                                     {std::string("In the environment: "), &given->from_environment}})
    if (const std::string fault = fault_of(*words); !fault.empty()) {
      std::cerr << "varimeshd: " << where << fault << '\n';
      return std::nullopt;
    }
  return std::move(*given);
}

}  // namespace

std::optional<Flags> parse_flags(int argc, char** argv, int* exit_status) {
  Program program(exit_status);
  program.app.name(argv[0]);
  const auto given = gather(program.app, argc, argv);
  if (!given) {
    *exit_status = 2;
    return std::nullopt;
  }
  try {
    program.parse(given->all());
    if (program.token_command->parsed()) return std::nullopt;
    for (const char* const command : {"check", "backup"})
      if (program.app.got_subcommand(command)) {
        std::cerr << "varimeshd: write the options of " << command << " behind it: varimeshd " << command
                  << " --state DIR\n";
        *exit_status = 2;
        return std::nullopt;
      }
  } catch (const CLI::ExtrasError&) {
    const CLI::App& used = program.token_command->parsed() ? *program.token_command : program.app;
    std::cerr << "varimeshd: " << message_about_unknown_word(used) << '\n';
    *exit_status = 2;
    return std::nullopt;
  } catch (const CLI::ParseError& error) {
    *exit_status = program.app.exit(error) == 0 ? 0 : 2;
    return std::nullopt;
  }
  if (const std::string text = asked_text(program.app); !text.empty()) {
    std::cout << text;
    return std::nullopt;
  }
  if (program.print_config) {
    std::cout << print_settings(program.app, *given);
    return std::nullopt;
  }
  program.finish();
  return std::move(program.flags);
}

}  // namespace varimesh::server
