// varimesh optimise: optimises a mesh, in this process or on a server.
#include "client/commands/commands.h"
#include "client/runs/optimise_run.h"

namespace varimesh::client {

Action add_optimise(Command program) {
  auto arguments = std::make_shared<OptimiseArguments>();
  Command command = program.add_command("optimise", "Optimise a mesh and write the result");
  command.alias("optimize");
  add_input(command, &arguments->input);
  command["input"].or_standard_input();
  add_geometry_flags(command, &arguments->input, true);
  add_run_flags(command, arguments.get());
  return [arguments] { return optimise(*arguments); };
}

}  // namespace varimesh::client
