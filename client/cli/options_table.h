// The table of the options of an optimisation. The flags, their help and the options in a report are made from it.
#pragma once

#include <span>
#include <string_view>

namespace varimesh::client {

/// One option. Its type and the values of an enum are those of the field in varimesh.v1.Options.
struct OptionRow {
  std::string_view field;  ///< The field's name in the C++ struct and in the message; the flag has dashes instead.
  std::string_view help;
};

std::span<const OptionRow> option_rows();

}  // namespace varimesh::client
