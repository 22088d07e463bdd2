// varimesh curve: makes a curved, optimised mesh from a straight one and its geometry.
#include "client/cli/option_flags.h"
#include "client/cli/refusals.h"
#include "client/commands/commands.h"
#include "client/runs/optimise_run.h"

namespace varimesh::client {

Action add_curve(CLI::App& app) {
  auto arguments = std::make_shared<OptimiseArguments>();
  CLI::App& command = *app.add_subcommand("curve", "Make a curved mesh from a straight one and its CAD model");
  command.add_option("input", arguments->input.mesh, "The mesh file to read, of order 1")
      ->required()
      ->check(is_not_a_dash())
      ->type_name("IN");
  add_geometry_flags(command, &arguments->input.geometry);
  add_run_flags(command, arguments.get());
  command.get_option("--geometry")->required();
  require_curved_order(command);
  return [arguments] { return curve(*arguments); };
}

}  // namespace varimesh::client
