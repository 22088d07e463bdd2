// The options of an optimisation as flags, by the table of the library (core/options/option_table.h).
#pragma once

#include <string>

#include "client/cli/parser.h"
#include "core/options/option_table.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// The help of an option: the sentence of the table, and the default unless the sentence says what 0 means.
std::string help_text(const OptionInfo& option);

/// Makes --order required, and lets it be only an order that a mesh is curved to. For after add_options().
void require_curved_order(Command command);

/// Adds a flag for each option of the table. A flag that is given sets its field in `options`; the others stay
/// unset.
void add_options(Command command, v1::Options* options);

}  // namespace varimesh::client
