// What the subcommands share: exit statuses, common flags, the way to a server, interrupts.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/client.h"
#include "client/command/leftovers.h"
#include "client/local/local.h"
#include "core/base/error.h"

namespace varimesh::client {

/// Exit statuses, the same for every subcommand.
enum ExitStatus {
  kDone = 0,
  kJobFailed = 1,  ///< The job failed, or somebody else cancelled it.
  kUsage = 2,
  kInputRefused = 3,  ///< The input was refused, or the output cannot be written.
  kInvalidLeft = 4,   ///< Finished, but elements are not certified valid.
  kServer = 5,        ///< Server or transport.
  kInterrupted = 130,
};

/// Flags that most subcommands have.
struct CommonFlags {
  std::string server;  ///< Empty: run the service in this process.
  bool json = false;
  bool quiet = false;
  bool compress = false;  ///< Of meshes on their way to a server and back.
};

void add_server_flag(CLI::App& command, CommonFlags* flags);
void add_json_flag(CLI::App& command, CommonFlags* flags);
void add_quiet_flag(CLI::App& command, CommonFlags* flags);
/// For commands that send or fetch meshes.
void add_compress_flag(CLI::App& command, CommonFlags* flags);

/// Prints "varimesh: sentence" on standard error and returns the status that the error means.
int report(const Error& error);
int report(const Failure& failure);
/// The status that the reason of a job's error, or of a refused call, means.
int status_of_reason(const std::string& reason);

/// Says on standard error how many elements are not certified valid; the status that this means.
int report_uncertified(std::int64_t invalid, std::int64_t undecided);

/// How often Ctrl-C was pressed. The first asks the command to stop in order, the second ends the process, leaving
/// nothing behind.
int interrupts();
/// Comes first, before any thread is made.
void catch_interrupts();
/// From now on the first ends the process too: for a command that has nothing to put in order.
void end_at_first_interrupt();

/// A client, and the service it talks to where that runs in this process.
struct Connection {
  std::unique_ptr<TemporaryFolder> folder;
  std::unique_ptr<LocalService> local;
  std::unique_ptr<Client> client;
};

/// Connects to the server, or starts the service here. An interrupt ends calls. Unless it is to be quiet, says when the
/// server goes away and when it is back.
tl::expected<Connection, int> connect(const CommonFlags& flags);

/// Whether a flag's value is text that can be sent.
const CLI::Validator& is_text();

/// Adds a subcommand; what it returns is the exit status.
using Run = std::function<int()>;
Run add_optimise(CLI::App& app);
Run add_submit(CLI::App& app);
Run add_watch(CLI::App& app);
Run add_result(CLI::App& app);
Run add_cancel(CLI::App& app);
Run add_delete(CLI::App& app);
Run add_jobs(CLI::App& app);
Run add_info(CLI::App& app);
Run add_quality(CLI::App& app);
Run add_convert(CLI::App& app);
Run add_doctor(CLI::App& app);
Run add_completion(CLI::App& app);
Run add_man(CLI::App& app);
/// All of them, by their names, with the program's own help and version.
std::vector<std::pair<std::string, Run>> add_commands(CLI::App& app);

}  // namespace varimesh::client
