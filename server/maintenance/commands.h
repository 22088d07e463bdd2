// The commands of varimeshd that do not serve: check, backup and health.
#pragma once

#include <optional>

namespace CLI {
class App;
}

namespace varimesh::server {

/// Names the commands in the help of the program. run_command() has their options.
void describe_commands(CLI::App& app);

/// Runs the command that the first word names and returns the exit status; nothing if it names none.
std::optional<int> run_command(int argc, char** argv);

}  // namespace varimesh::server
