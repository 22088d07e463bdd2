// varimesh: the command.
#include <exception>
#include <iostream>

#include "client/command/command.h"
#include "core/version.h"

int main(int argc, char** argv) {
  using namespace varimesh::client;
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
  const std::pair<const char*, Run> commands[] = {
      {"optimise", add_optimise(app)}, {"submit", add_submit(app)},   {"watch", add_watch(app)},
      {"result", add_result(app)},     {"cancel", add_cancel(app)},   {"jobs", add_jobs(app)},
      {"info", add_info(app)},         {"quality", add_quality(app)}, {"convert", add_convert(app)}};
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kDone : kUsage;
  }
  catch_interrupts();
  try {
    for (const auto& [name, run] : commands)
      if (app.got_subcommand(name)) return run();
  } catch (const std::bad_alloc&) {
    std::cerr << "varimesh: the memory did not suffice; use a machine with more, or a smaller mesh." << std::endl;
  } catch (const std::exception& error) {
    std::cerr << "varimesh: ended unexpectedly (" << error.what() << "); please report it." << std::endl;
  }
  return kJobFailed;
}
