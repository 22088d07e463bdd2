// varimesh, the command: it parses the command line and carries out the subcommand.
#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <string>
#include <system_error>
#include <vector>

#include "client/cli/help.h"
#include "client/cli/refusals.h"
#include "client/commands/commands.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/machine_memory.h"

namespace {

using namespace varimesh::client;

/// Opens /dev/null for standard descriptors that are closed. Otherwise the next file that is opened would get such a
/// descriptor, and everything that is printed would go into that file.
void fill_standard_descriptors() {
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(descriptor, F_GETFD) < 0) (void)::open("/dev/null", descriptor == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}

/// The command itself says what went wrong, in its own words. gRPC's lines for developers would stand between them,
/// also about nothing ("Waiting for thread pool to idle"). With GRPC_VERBOSITY in the environment they are shown.
void silence_grpc() { ::setenv("GRPC_VERBOSITY", "NONE", 0); }

/// Whether nobody reads standard output any more, as after "| head -1".
bool has_no_reader() {
  pollfd output{STDOUT_FILENO, POLLOUT, 0};
  return ::poll(&output, 1, 0) == 1 && (output.revents & POLLERR) != 0;
}

/// Flushes standard output and returns the exit status: `status`, or a failure if not everything could be written. That
/// a reader has seen enough is no failure.
int flush_output(int status) {
  errno = 0;
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::cout && std::ferror(stdout) == 0) return status;
  if (errno == EPIPE || has_no_reader()) return status;
  const std::string why = errno == 0 ? std::string() : " (" + std::system_category().message(errno) + ")";
  std::cerr << "varimesh: standard output cannot be written" << why << "; check where it goes." << std::endl;
  return status == kDone || status == kInvalidLeft ? kInputRefused : status;
}

/// Prints what is wrong with the command line and where to find help.
int refuse(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& words) {
  const std::string unknown = unknown_word(app, words);
  const auto used = app.get_subcommands();
  std::cerr << "varimesh: " << (unknown.empty() ? refusal_text(app, error) : unknown) << "\nvarimesh "
            << (used.empty() ? "" : used.front()->get_name() + " ") << "--help shows examples and all options."
            << std::endl;
  return kUsage;
}

int execute(int argc, char** argv) {
  CLI::App app;
  const auto commands = add_commands(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    return refuse(app, error, {argv + 1, argv + argc});
  }
  try {
    for (const auto& [name, action] : commands)
      if (app.got_subcommand(name)) return action();
  } catch (const std::bad_alloc&) {
    std::cerr << "varimesh: there is not enough memory; use a machine with more memory, or a smaller mesh."
              << std::endl;
  } catch (const std::exception& error) {
    std::cerr << "varimesh: ended unexpectedly (" << error.what() << "); please report it." << std::endl;
  }
  return kJobFailed;
}

}  // namespace

int main(int argc, char** argv) {
  fill_standard_descriptors();
  silence_grpc();
  varimesh::return_large_blocks();
  catch_interrupts();
  return flush_output(execute(argc, argv));
}
