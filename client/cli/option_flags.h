// The options of an optimisation as flags, by the table of the library (core/options/option_table.h).
#pragma once

#include <CLI/CLI.hpp>

#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// Adds a flag for each option of the table. A flag that is given sets its field in `options`; the others stay
/// unset.
void add_options(CLI::App& command, v1::Options* options);

}  // namespace varimesh::client
