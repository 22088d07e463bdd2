// The commands and their flags, read from the parser itself. The help, the manual, completion and suggestions are all
// made from this, so they agree with what is parsed.
#pragma once

#include <span>
#include <vector>

#include "core/command_line/facts.h"

namespace CLI {
class App;
}

namespace varimesh::client {

/// The examples of all commands.
std::span<const Example> all_examples();

/// The facts of a subcommand or of the program.
CommandFacts facts_of(const CLI::App& command);
/// The facts of all subcommands, in the order of the help.
std::vector<CommandFacts> subcommand_facts(const CLI::App& program);
/// The facts of the program with all subcommands.
ProgramFacts program_facts(const CLI::App& program);

}  // namespace varimesh::client
