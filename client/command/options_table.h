// The options of an optimisation as flags: one table drives the flags, their help and the message that is sent.
#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string_view>

#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// One option. Its type, and for an enum its values, are those of the field in varimesh.v1.Options.
struct OptionRow {
  std::string_view field;  ///< As in the C++ struct and the message; the flag is the same with dashes.
  std::string_view help;
};

std::span<const OptionRow> option_rows();

/// Adds a flag for each row, which sets the field of `options`. What is not given stays unset.
void add_options(CLI::App& command, v1::Options* options);

}  // namespace varimesh::client
