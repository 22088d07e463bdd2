// varimesh curve: makes a curved, optimised mesh from a straight one and its geometry.
#include "client/cli/option_flags.h"
#include "client/commands/commands.h"
#include "client/runs/optimise_run.h"

namespace varimesh::client {

Action add_curve(Command program) {
  auto arguments = std::make_shared<OptimiseArguments>();
  Command command = program.add_command("curve", "Make a curved mesh from a straight one and its CAD model");
  command.add("input", &arguments->input.mesh, "The mesh file to read, of order 1")
      .required()
      .or_standard_input()
      .value("IN");
  add_geometry_flags(command, &arguments->input, false);
  add_run_flags(command, arguments.get());
  command["--output"].required();
  command["--geometry"].required();
  require_curved_order(command);
  return [arguments] { return curve(*arguments); };
}

}  // namespace varimesh::client
