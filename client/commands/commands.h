// The subcommands. Each adds itself to the parser and returns the action that carries it out.
#pragma once

#include "client/cli/parser.h"

namespace varimesh::client {

Action add_optimise(Command program);
Action add_curve(Command program);
Action add_mesh(Command program);
Action add_quality(Command program);
Action add_layers(Command program);
Action add_convert(Command program);
Action add_submit(Command program);
Action add_watch(Command program);
Action add_result(Command program);
Action add_wait(Command program);
Action add_results(Command program);
Action add_jobs(Command program);
Action add_cancel(Command program);
Action add_delete(Command program);
Action add_info(Command program);
Action add_doctor(Command program);
Action add_certificates(Command program);
Action add_completion(Command program);
Action add_man(Command program);

/// Adds all subcommands, and the program's own help and version. Returns the actions in the order of the help.
Actions add_commands(Command program);

}  // namespace varimesh::client
