// The manual pages, made from the facts of the commands.
#pragma once

#include <string>
#include <vector>

#include "client/cli/command_facts.h"

namespace varimesh::client {

/// The manual page of the program or of a command, as troff. `commands` are listed on the program's page; empty for the
/// page of a command.
std::string manual_page(const CommandFacts& facts, const std::vector<CommandFacts>& commands);

}  // namespace varimesh::client
