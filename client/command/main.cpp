// varimesh: the command.
#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <exception>
#include <iostream>
#include <system_error>

#include "client/command/command.h"
#include "core/version.h"

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

int run(int argc, char** argv) {
  CLI::App app{
      "Moves the interior nodes of a curved high-order mesh until it is valid and smooth.\n\n"
      "  varimesh optimise wing.msh -o better.msh -o better.vtu    here\n"
      "  varimesh optimise wing.msh -o better.msh --server HOST:PORT\n"
      "  varimesh submit wing.msh --server HOST:PORT               and later watch, result\n"
      "  varimesh quality wing.msh\n"
      "  varimesh convert wing.msh wing.vtu\n\n"
      "Exit status: 0 done and valid; 1 the job failed or was cancelled by someone else; 2 usage; 3 the input was "
      "refused; 4 finished but elements are invalid; 5 server or transport; 130 interrupted.",
      "varimesh"};
  app.set_version_flag("--version", std::string(varimesh::version()));
  app.require_subcommand(1);
  const std::pair<const char*, Run> commands[] = {{"optimise", add_optimise(app)}, {"submit", add_submit(app)},
                                                  {"watch", add_watch(app)},       {"result", add_result(app)},
                                                  {"cancel", add_cancel(app)},     {"delete", add_delete(app)},
                                                  {"jobs", add_jobs(app)},         {"info", add_info(app)},
                                                  {"quality", add_quality(app)},   {"convert", add_convert(app)}};
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUsage;
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
