// Completion scripts for shells, made from the facts of the commands.
#pragma once

#include <string>
#include <vector>

#include "client/cli/command_facts.h"

namespace varimesh::client {

/// Scripts that complete commands, flags and the values of flags. `program` is the program itself, `commands` are its
/// subcommands.
std::string bash_completion(const CommandFacts& program, const std::vector<CommandFacts>& commands);
std::string zsh_completion(const std::vector<CommandFacts>& commands);
std::string fish_completion(const std::vector<CommandFacts>& commands);

}  // namespace varimesh::client
