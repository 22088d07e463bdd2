// varimesh optimise: optimises a mesh, or several, in this process or on a server.
#include "client/commands/commands.h"
#include "client/process/exit_status.h"
#include "client/runs/several_runs.h"

namespace varimesh::client {
namespace {

struct Arguments {
  OptimiseArguments run;
  std::vector<std::string> meshes;
  std::string into;
};

Expected<void> check_outputs_named(const Arguments& arguments) {
  if (!arguments.into.empty()) return {};
  if (arguments.run.outputs.empty())
    return bad_option(
        "--output is required; name the file for the result, or with --into the folder for several results.");
  if (arguments.meshes.size() > 1)
    return bad_option("Several meshes need a folder for their results; name one with --into in place of --output.");
  return {};
}

int run(const Arguments& arguments, const OptimiseRun& run_one, const SeveralRun& run_several) {
  if (!arguments.into.empty()) return run_several(arguments.run, arguments.meshes, arguments.into);
  OptimiseArguments one = arguments.run;
  one.input.mesh = arguments.meshes.front();
  return run_one(one);
}

}  // namespace

Action add_optimise(Command program, const OptimiseRun& run_one, const SeveralRun& run_several,
                    bool keeps_checkpoints) {
  auto arguments = std::make_shared<Arguments>();
  Command command = program.add_command(
      "optimise", "Move interior nodes until every element is valid and the mesh accurate, and write the result");
  command.alias("optimize");
  add_inputs(command, &arguments->meshes, &arguments->run.input);
  command["input"].or_standard_input().help("The mesh file to read; with --into, several");
  add_geometry_flags(command, &arguments->run.input, true);
  add_run_flags(command, &arguments->run);
  if (keeps_checkpoints) add_checkpoint_flags(command, &arguments->run);
  add_keep_orders_flag(command, &arguments->run.input.keep_orders);
  command
      .add("--into", &arguments->into,
           "Optimise all meshes side by side, and write the results into this folder, under the names of the meshes")
      .value("DIR")
      .excludes("--output");
  command.at_end([arguments] { return check_outputs_named(*arguments); });
  return [arguments, run_one, run_several] { return run(*arguments, run_one, run_several); };
}

}  // namespace varimesh::client
