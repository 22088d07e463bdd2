// The subcommands. Each adds itself to the parser and returns the action that carries it out.
#pragma once

#include "client/cli/parser.h"
#include "client/runs/optimise_run.h"
#include "client/runs/quality_run.h"
#include "client/runs/several_runs.h"

namespace varimesh::client {

/// @param keeps_checkpoints  the runs of one mesh keep their state in a file, if that is asked for
Action add_optimise(Command program, const OptimiseRun& run_one, const SeveralRun& run_several, bool keeps_checkpoints);
Action add_curve(Command program);
Action add_mesh(Command program);
Action add_layers(Command program);
Action add_convert(Command program);
Action add_submit(Command program);
Action add_watch(Command program);
Action add_logs(Command program);
Action add_result(Command program);
Action add_wait(Command program);
Action add_results(Command program);
Action add_jobs(Command program);
Action add_cancel(Command program);
Action add_delete(Command program);
Action add_info(Command program);
Action add_doctor(Command program);
Action add_certificates(Command program);
Action add_ui(Command program);
Action add_completion(Command program);
Action add_man(Command program);

/// Judges a mesh in this process, which has all of it in memory.
int quality_of_file(const QualityArguments& arguments);
Action add_quality(Command program, const QualityRun& run);

/// Adds all subcommands, and the program's own help and version. Returns the actions in the order of the help. As one
/// of several processes that a launcher started, the commands refuse.
Actions add_commands(Command program);

/// The same for a program whose processes share the work. Commands that cannot do that refuse.
/// @param quality, optimise carry out the commands of these names, in all processes together
Actions add_commands_of_ranks(Command program, const QualityRun& quality, const OptimiseRun& optimise);

/// Runs the command line of a program with these commands, and returns its exit status. Prints what went wrong, also if
/// standard output cannot be written.
int run_program(int argc, char** argv, const std::function<Actions(Command)>& add);

}  // namespace varimesh::client
