// The options of an optimisation in one table: name, type, range, default, one sentence of help.
//
// check() takes its ranges from it. The server converts varimesh.v1.Options by it, the command makes its flags and
// their help from it, and tests hold the contract, docs/options.md and the Python keywords against it. A new option is
// its field in Options, one line in this table, a field of the same name in varimesh.v1.Options, and its use.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/options/options.h"

namespace varimesh {

/// An option that takes one of several words. Values are those of its enum, from 0 in the order of `words`.
struct ChoiceMember {
  std::span<const std::string_view> words;
  int (*get)(const Options& options);
  void (*set)(Options& options, int value);
};

/// The field of Options that holds the value. The type of the option follows from it: a number, a whole number, on or
/// off, names, node numbers, a word out of several, or a field read from a file.
using OptionMember =
    std::variant<double Options::*, int Options::*, bool Options::*, std::vector<std::string> Options::*,
                 std::vector<std::int64_t> Options::*, ChoiceMember, TargetField Options::*>;

/// The values that a number may have. NaN and infinity are never among them.
struct OptionRange {
  double least = 0;
  double most = std::numeric_limits<double>::infinity();
  bool without_least = false;  ///< `least` itself is refused.
  bool without_most = false;   ///< `most` itself is refused.

  bool contains(double value) const;
};

struct OptionInfo {
  std::string_view name;  ///< As in Options, in the contract and in Python; the flag is the same with dashes.
  OptionMember member;
  OptionRange range;        ///< Of a number; not used otherwise.
  std::string_view values;  ///< What values there are, in words, for pages and refusals; empty if the type says it.
  std::string_view help;    ///< One sentence, without the default.
};

/// All options, in the order in which help and pages show them.
std::span<const OptionInfo> option_table();

/// The default as a user would write it: "1e-6", "on", "straight-sided"; empty for a list or a field.
std::string default_text(const OptionInfo& option);

/// Whether its value is a number or a whole number.
bool is_number(const OptionInfo& option);
/// The value of such an option; NaN for other types.
double number_of(const OptionInfo& option, const Options& options);
/// The shortest digits that mean the number: "1e-6", "0.25", "nan".
std::string number_text(double value);

}  // namespace varimesh
