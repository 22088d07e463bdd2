// What every program with commands does before and after its command.
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

#include "client/commands/commands.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/machine_memory.h"

namespace varimesh::client {
namespace {

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
  return status == kDone || status == kInvalidLeft || status == kPartLeft ? kInputRefused : status;
}

int execute(int argc, char** argv, const std::function<Actions(Command)>& add) {
  try {
    return run_command_line(argc, argv, add);
  } catch (const std::bad_alloc&) {
    std::cerr << "varimesh: there is not enough memory; use a machine with more memory, or a smaller mesh."
              << std::endl;
  } catch (const std::exception& error) {
    std::cerr << "varimesh: ended unexpectedly (" << error.what() << "); please report it." << std::endl;
  }
  return kJobFailed;
}

}  // namespace

int run_program(int argc, char** argv, const std::function<Actions(Command)>& add) {
  fill_standard_descriptors();
  silence_grpc();
  return_large_blocks();
  catch_interrupts();
  return flush_output(execute(argc, argv, add));
}

}  // namespace varimesh::client
