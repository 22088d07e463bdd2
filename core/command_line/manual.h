// Manual pages, made from the facts of a program.
#pragma once

#include <string>

#include "core/command_line/facts.h"

namespace varimesh {

/// The manual page of the program or of one of its commands, as troff. That of the program lists the commands.
std::string manual_page(const ProgramFacts& program, const CommandFacts& facts);

}  // namespace varimesh
