// Shared parts of the subcommands.
#include "client/command/command.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <iostream>
#include <thread>

#include "core/base/utf8.h"

namespace varimesh::client {
namespace {

std::atomic<int> interrupt_count = 0;
std::atomic<bool> first_ends = false;

[[noreturn]] void end_at_once() {
  remove_leftovers();
  constexpr char message[] = "varimesh: interrupted\n";
  (void)!::write(STDERR_FILENO, message, sizeof message - 1);
  _exit(kInterrupted);
}

void say_contact(bool answers, std::chrono::milliseconds retry) {
  // On a terminal the bar is there, which the next iteration draws again.
  if (isatty(STDERR_FILENO) == 1) std::cerr << "\r\x1b[K";
  if (answers)
    std::cerr << "varimesh: the server answers again" << std::endl;
  else
    std::cerr << "varimesh: the server is not answering; trying again for up to " << retry.count() / 1000 << " s"
              << std::endl;
}

}  // namespace

void add_server_flag(CLI::App& command, CommonFlags* flags) {
  command.add_option("--server", flags->server, "HOST:PORT or unix:PATH of a varimeshd")->type_name("ADDRESS");
}
void add_json_flag(CLI::App& command, CommonFlags* flags) {
  command.add_flag("--json", flags->json, "Print one JSON document on standard output, and nothing else there");
}
void add_quiet_flag(CLI::App& command, CommonFlags* flags) {
  command.add_flag("-q,--quiet", flags->quiet, "No progress and no summary");
}

void add_compress_flag(CLI::App& command, CommonFlags* flags) {
  command.add_flag("--compress", flags->compress,
                   "Compress meshes on their way to the server and back: for slow networks");
}

int status_of_reason(const std::string& reason) {
  if (reason == "BAD_INPUT" || reason == "OUTPUT" || reason == "MESH_TOO_LARGE") return kInputRefused;
  if (reason == "BAD_OPTION" || reason == "BAD_REQUEST" || reason == "JOB_NOT_FOUND" || reason == "JOB_NOT_ENDED" ||
      reason == "REQUEST_ID_USED")
    return kUsage;
  if (reason == "STORE_FULL" || reason == "QUEUE_FULL" || reason == "PEER_LIMIT" || reason == "STOPPING")
    return kServer;
  return kJobFailed;
}

int report(const Error& error) {
  std::cerr << "varimesh: " << error.sentence << std::endl;
  switch (error.kind) {
    case Error::Kind::BadInput:
    case Error::Kind::Output:
      return kInputRefused;
    case Error::Kind::BadOption:
      return kUsage;
    case Error::Kind::Internal:
      break;
  }
  return kJobFailed;
}

int report_uncertified(std::int64_t invalid, std::int64_t undecided) {
  if (invalid > 0)
    std::cerr << "varimesh: " << invalid << (invalid == 1 ? " element is" : " elements are") << " invalid" << std::endl;
  if (undecided > 0)
    std::cerr << "varimesh: " << undecided << (undecided == 1 ? " element is" : " elements are")
              << " neither proved valid nor proved invalid" << std::endl;
  return invalid + undecided == 0 ? kDone : kInvalidLeft;
}

int report(const Failure& failure) {
  std::cerr << "varimesh: " << failure.sentence << std::endl;
  switch (failure.kind) {
    case Failure::Kind::Transport:
      return kServer;
    case Failure::Kind::File:
      return kInputRefused;
    case Failure::Kind::Interrupted:
      return kInterrupted;
    case Failure::Kind::Refused:
      break;
  }
  return status_of_reason(failure.reason);
}

int interrupts() { return interrupt_count; }

void catch_interrupts() {
  // A thread takes them, so that it may do what a handler may not. All threads to come inherit that they are blocked.
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::thread([signals] {
    for (int signal = 0; sigwait(&signals, &signal) == 0;)
      if (interrupt_count.fetch_add(1) > 0 || first_ends) end_at_once();
  }).detach();
}

void end_at_first_interrupt() {
  first_ends = true;
  if (interrupts() > 0) end_at_once();
}

tl::expected<Connection, int> connect(const CommonFlags& flags) {
  Settings settings;
  settings.interrupted = [] { return interrupts() > 0; };
  if (!flags.quiet) settings.on_contact = [retry = settings.retry](bool answers) { say_contact(answers, retry); };
  settings.compress = flags.compress && !flags.server.empty();
  Connection connection;
  if (flags.server.empty()) {
    connection.folder = std::make_unique<TemporaryFolder>();
    auto local = LocalService::start(connection.folder->path());
    if (!local) return tl::unexpected(report(local.error()));
    connection.local = std::move(*local);
    connection.client = std::make_unique<Client>(connection.local->channel(), connection.local->channel(), settings);
    return connection;
  }
  auto client = Client::connect(flags.server, settings);
  if (!client) return tl::unexpected(report(client.error()));
  connection.client = std::make_unique<Client>(std::move(*client));
  return connection;
}

const CLI::Validator& is_text() {
  static const CLI::Validator validator(
      [](std::string& value) {
        return is_utf8(value) ? std::string()
                                       : "'" + as_utf8(value) +
                                             "' is not UTF-8, and nothing else can be sent; a physical group can be "
                                             "named by its tag.";
      },
      "", "text");
  return validator;
}

}  // namespace varimesh::client
