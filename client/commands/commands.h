// The subcommands. Each adds itself to the parser and returns the action that carries it out.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <utility>
#include <vector>

namespace varimesh::client {

/// Carries out a command and returns the exit status.
using Action = std::function<int()>;

Action add_optimise(CLI::App& app);
Action add_curve(CLI::App& app);
Action add_mesh(CLI::App& app);
Action add_quality(CLI::App& app);
Action add_convert(CLI::App& app);
Action add_submit(CLI::App& app);
Action add_watch(CLI::App& app);
Action add_result(CLI::App& app);
Action add_wait(CLI::App& app);
Action add_results(CLI::App& app);
Action add_jobs(CLI::App& app);
Action add_cancel(CLI::App& app);
Action add_delete(CLI::App& app);
Action add_info(CLI::App& app);
Action add_doctor(CLI::App& app);
Action add_certificates(CLI::App& app);
Action add_completion(CLI::App& app);
Action add_man(CLI::App& app);

/// Adds all subcommands, and the program's own help and version. Returns the commands' names and actions in the order
/// of the help.
std::vector<std::pair<std::string, Action>> add_commands(CLI::App& app);

}  // namespace varimesh::client
