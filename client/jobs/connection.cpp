#include "client/jobs/connection.h"

#include <unistd.h>

#include <iostream>

#include "client/process/exit_status.h"
#include "client/process/interrupts.h"

namespace varimesh::client {
namespace {

void print_contact(bool answers, std::chrono::milliseconds retry) {
  // On a terminal, clear the progress bar; the next iteration draws it again.
  if (isatty(STDERR_FILENO) == 1) std::cerr << "\r\x1b[K";
  if (answers)
    std::cerr << "varimesh: the server answers again" << std::endl;
  else
    std::cerr << "varimesh: the server is not answering; trying again for up to " << retry.count() / 1000 << " s"
              << std::endl;
}

}  // namespace

tl::expected<Connection, int> connect(const CommonFlags& flags) {
  Settings settings;
  settings.interrupted = interrupt_ends_calls;
  if (!flags.quiet) settings.on_contact = [retry = settings.retry](bool answers) { print_contact(answers, retry); };
  if (!flags.quiet)
    settings.on_slow_contact = [&flags, wait = settings.connect] {
      std::cerr << "varimesh: nothing answers at " << flags.server << " yet; waiting for up to " << wait.count() / 1000
                << " s" << std::endl;
    };
  settings.compress = flags.compress && !flags.server.empty();
  settings.credentials = flags.credentials;
  Connection connection;
  if (flags.server.empty()) {
    connection.folder = std::make_unique<TemporaryFolder>();
    auto local = LocalService::start(connection.folder->path());
    if (!local) return tl::unexpected(print_error(local.error()));
    connection.local = std::move(*local);
    settings.exchange = connection.local->exchange();
    connection.client = std::make_unique<Client>(connection.local->channel(), connection.local->channel(), settings);
    return connection;
  }
  auto client = Client::connect(flags.server, settings);
  if (!client) return tl::unexpected(print_error(client.error()));
  connection.client = std::make_unique<Client>(std::move(*client));
  return connection;
}

}  // namespace varimesh::client
