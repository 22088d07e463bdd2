// Shared parts of the subcommands.
#include "client/command/command.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <iostream>

namespace varimesh::client {
namespace {

std::atomic<int> interrupt_count = 0;

extern "C" void on_interrupt(int) {
  if (interrupt_count.fetch_add(1) > 0) _exit(kInterrupted);
}

}  // namespace

void add_server_flag(CLI::App& command, CommonFlags* flags) {
  command.add_option("--server", flags->server, "HOST:PORT or unix:PATH of a varimeshd");
}
void add_json_flag(CLI::App& command, CommonFlags* flags) {
  command.add_flag("--json", flags->json, "Print one JSON document on standard output, and nothing else there");
}
void add_quiet_flag(CLI::App& command, CommonFlags* flags) {
  command.add_flag("-q,--quiet", flags->quiet, "No progress and no summary");
}

int status_of_reason(const std::string& reason) {
  if (reason == "BAD_INPUT" || reason == "OUTPUT" || reason == "MESH_TOO_LARGE") return kInputRefused;
  if (reason == "BAD_OPTION" || reason == "BAD_REQUEST" || reason == "JOB_NOT_FOUND" || reason == "REQUEST_ID_USED")
    return kUsage;
  if (reason == "STORE_FULL" || reason == "QUEUE_FULL" || reason == "STOPPING") return kServer;
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
  struct sigaction action {};
  action.sa_handler = on_interrupt;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

tl::expected<Connection, int> connect(const std::string& server, bool survive_interrupts) {
  Settings settings;
  if (!survive_interrupts) settings.interrupted = [] { return interrupts() > 0; };
  Connection connection;
  if (server.empty()) {
    auto local = LocalService::start();
    if (!local) return tl::unexpected(report(local.error()));
    connection.local = std::move(*local);
    connection.client = std::make_unique<Client>(connection.local->channel(), connection.local->channel(), settings);
    return connection;
  }
  auto client = Client::connect(server, settings);
  if (!client) return tl::unexpected(report(client.error()));
  connection.client = std::make_unique<Client>(std::move(*client));
  return connection;
}

}  // namespace varimesh::client
