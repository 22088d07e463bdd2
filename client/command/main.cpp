// varimesh: the command.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <exception>
#include <iostream>
#include <string>
#include <system_error>
#include <vector>

#include "client/command/command.h"
#include "client/command/help.h"

namespace {

using namespace varimesh::client;

/// A descriptor that is closed from the start would be the next file's, and that would get what is printed.
void fill_standard_descriptors() {
  for (const int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(descriptor, F_GETFD) < 0) (void)::open("/dev/null", descriptor == STDIN_FILENO ? O_WRONLY : O_RDONLY);
}

/// What was printed has to have arrived.
int after_printing(int status) {
  errno = 0;
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::cout && std::ferror(stdout) == 0) return status;
  const std::string why = errno == 0 ? std::string() : " (" + std::system_category().message(errno) + ")";
  std::cerr << "varimesh: standard output cannot be written" << why << "; see where it goes." << std::endl;
  return status == kDone || status == kInvalidLeft ? kInputRefused : status;
}

/// What is wrong with a command line, and where to look.
int refuse(const CLI::App& app, const CLI::ParseError& error, const std::vector<std::string>& words) {
  const std::string unknown = unknown_word(app, words);
  const auto used = app.get_subcommands();
  std::cerr << "varimesh: " << (unknown.empty() ? error.what() : unknown) << "\nvarimesh "
            << (used.empty() ? "" : used.front()->get_name() + " ") << "--help has examples and all options."
            << std::endl;
  return kUsage;
}

int run(int argc, char** argv) {
  CLI::App app;
  const auto commands = add_commands(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);
    return refuse(app, error, {argv + 1, argv + argc});
  }
  try {
    for (const auto& [name, carry_out] : commands)
      if (app.got_subcommand(name)) return carry_out();
  } catch (const std::bad_alloc&) {
    std::cerr << "varimesh: the memory did not suffice; use a machine with more, or a smaller mesh." << std::endl;
  } catch (const std::exception& error) {
    std::cerr << "varimesh: ended unexpectedly (" << error.what() << "); please report it." << std::endl;
  }
  return kJobFailed;
}

}  // namespace

int main(int argc, char** argv) {
  fill_standard_descriptors();
  catch_interrupts();
  return after_printing(run(argc, argv));
}
