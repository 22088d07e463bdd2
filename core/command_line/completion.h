// Completion scripts for shells, made from the facts of a program.
#pragma once

#include <string>

#include "core/command_line/facts.h"

namespace varimesh {

/// Scripts that complete the commands of a program, all flags, and the values of flags. Where a command
/// takes the names of jobs, they ask the program for them.
std::string bash_completion(const ProgramFacts& program);
std::string zsh_completion(const ProgramFacts& program);
std::string fish_completion(const ProgramFacts& program);

}  // namespace varimesh
