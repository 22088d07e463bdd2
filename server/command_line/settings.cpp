#include "server/command_line/settings.h"

#include <CLI/CLI.hpp>
#include <map>
#include <string>

namespace varimesh::server {

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
  app.add_option("--https", options.https,
                 "HOST:PORT for HTTP and JSON with TLS, which other machines may reach. It uses the files of the --tls "
                 "flags, and callers need the same tokens or certificates as at --listen; port 0 is any free port");
  app.add_option(
      "--metrics", options.metrics,
      "HOST:PORT for plain HTTP that other machines may reach: metrics for Prometheus, and health checks; port "
      "0 is any free port");
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
                 "File with the authority of the server that keys are fetched from, in PEM (default: the machine's "
                 "authorities)");
  app.add_option("--jwt-issuer", options.web_tokens.issuer, "The claim iss of the issuer's tokens");
  app.add_option("--jwt-audience", options.web_tokens.audience,
                 "What the claim aud of the issuer's tokens must be or contain");
  app.add_option("--jwt-owner-claim", options.web_tokens.owner_claim, "The claim with the owner of a token")
      ->capture_default_str();
  app.add_option("--jwt-roles-claim", options.web_tokens.roles_claim,
                 "The claim with the roles (submit, read, cancel, admin), as a list or with spaces between them")
      ->capture_default_str();
  app.add_option(
      "--tls-certificate", options.tls.certificate,
      "File with the server's certificate and the certificates between it and its authority, in PEM. Connections "
      "are then encrypted. The files of the --tls flags are read again when they change");
  app.add_option("--tls-key", options.tls.key, "File with the private key of the certificate, in PEM");
  app.add_option(
      "--tls-authority", options.tls.authority,
      "File with the authority whose certificates clients must have, in PEM. Without --tokens, jobs belong to "
      "the common name in the client's certificate");
  app.add_flag(
      "--insecure", options.insecure,
      "Allow --listen, --http and --https beyond loopback although everybody may call, or nothing is encrypted");
  app.add_option("--port-file", flags.port_file, "Write the address to this file instead of standard output");
  app.add_option("--log-format", flags.log_format, "text, or json: one object a line")->capture_default_str();
  app.add_option("--log-level", flags.log_level, "trace, debug, info, warn, error or off")->capture_default_str();
}

void add_webhook_flags(CLI::App& app, WebhookSettings& webhooks, Units& units) {
  app.add_option("--webhooks", webhooks.file,
                 "File of the servers that jobs may have called at their end, which only this user can read: one line "
                 "each, https://HOST KEY, and 'private' behind it if the address may be in a private network. It is "
                 "read again when it changes (default: nobody is called)");
  app.add_option("--webhook-authority", webhooks.authority,
                 "File with the authority of these servers, in PEM (default: the machine's authorities)");
  app.add_option("--webhook-seconds", units.webhook_seconds,
                 "Seconds until a call that failed is made again; each later pause is twice as long, up to an hour")
      ->capture_default_str()
      ->check(CLI::Range(0.01, 3600.0));
  app.add_option("--webhook-attempts", webhooks.most_attempts, "Calls at the end of one job before the server gives up")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
}

void add_resource_flags(CLI::App& app, Flags& flags) {
  Limits& limits = flags.options.limits;
  app.add_option("--isolation", flags.runs_in_processes,
                 "'process' runs each job in a process of its own, without files and network, which may crash without "
                 "harm to others; 'none' runs all jobs in the server's process")
      ->transform(CLI::CheckedTransformer(std::map<std::string, bool>{{"process", true}, {"none", false}}))
      ->type_name("process|none")
      ->default_str(flags.runs_in_processes ? "process" : "none");
  app.add_option("--threads", limits.threads, "Threads shared by the running jobs; 0: all threads of the machine")
      ->check(CLI::Range(0, 4096));
  app.add_option("--devices", flags.devices,
                 "Graphics cards that jobs with the option device may have, each one job at a time: the first ones of "
                 "CUDA_VISIBLE_DEVICES. The processes of these jobs have a weaker sandbox; 0: no job has a device")
      ->capture_default_str()
      ->check(CLI::Range(0, 64));
  app.add_option("--jobs-per-device", flags.options.jobs_per_device, "Jobs that may have the same device at a time")
      ->capture_default_str()
      ->check(CLI::Range(1, 64));
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
                 "The most iterations of a job; a job that asks for more is refused")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  app.add_option("--max-job-seconds", limits.max_job_seconds,
                 "The most seconds that a job may run; a job that asks for more is refused, and a job without a time "
                 "limit gets this limit")
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
  app.add_option("--max-ended-jobs", limits.max_ended_jobs,
                 "Ended jobs of an owner that are remembered, with their results; older ones are deleted after "
                 "--min-ended-age")
      ->capture_default_str()
      ->check(CLI::NonNegativeNumber);
  app.add_option("--min-ended-age", units.ended_minutes,
                 "Minutes for which every ended job is remembered, however many jobs have ended")
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

}  // namespace varimesh::server
