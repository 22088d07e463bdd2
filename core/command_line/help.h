// The text of --help.
#pragma once

#include <cstddef>
#include <functional>
#include <string>

#include "core/command_line/facts.h"

namespace varimesh {

/// The help of a program or of one of its commands, examples first, `width` characters wide.
/// @param is_shown  which flags are listed; a last line counts the others and says where they are. Empty: all.
std::string help_text(const ProgramFacts& program, const CommandFacts& facts, std::size_t width,
                      const std::function<bool(const FlagFacts&)>& is_shown = {});

}  // namespace varimesh
