// The options of an optimisation, of a geometry and of layers, in tables: name, type, range, default, one sentence of
// help.
//
// check() takes the ranges from this table. The server uses it to convert varimesh.v1.Options, and the command makes
// its flags and their help from it. Tests compare the contract, docs/options.md and the Python keywords with it. A new
// option needs a field in Options, one line in this table, a field of the same name in varimesh.v1.Options, and the
// code that uses it. The same holds for GeometryOptions and varimesh.v1.Geometry, and for LayerOptions and
// varimesh.v1.Layers.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "core/options/geometry_options.h"
#include "core/options/layer_options.h"
#include "core/options/options.h"

namespace varimesh {

/// An option of the struct `Of` that takes one of several words. The values are those of its enum: 0, 1, … in the order
/// of `words`.
template <class Of>
struct ChoiceOf {
  std::span<const std::string_view> words;
  int (*get)(const Of& options);
  void (*set)(Of& options, int value);
};

/// The field of `Of` that holds the value. It determines the type of the option: a number, a whole number, on or off,
/// names, node numbers, several numbers, one of several words, or a field that is read from a file.
template <class Of>
using MemberOf =
    std::variant<double Of::*, int Of::*, bool Of::*, std::vector<std::string> Of::*, std::vector<std::int64_t> Of::*,
                 std::vector<double> Of::*, ChoiceOf<Of>, TargetField Of::*>;

/// The values that a number may have. NaN and infinity are always refused.
struct OptionRange {
  double least = 0;
  double most = std::numeric_limits<double>::infinity();
  bool without_least = false;  ///< `least` itself is refused.
  bool without_most = false;   ///< `most` itself is refused.

  bool contains(double value) const;
};

/// One row of a table.
template <class Of>
struct OptionOf {
  std::string_view name;  ///< The name in `Of`, in the contract and in Python; the flag has dashes instead.
  MemberOf<Of> member;
  OptionRange range;        ///< For numbers only.
  std::string_view values;  ///< The possible values in words, for pages and errors; empty if the type says it.
  std::string_view help;    ///< One sentence, without the default.
  /// For an option that is on or off, and off by default: the name of the flag that says off. Its flags take no value.
  std::string_view opposite = {};
  std::string_view flag = {};  ///< The flag's name without dashes in front, if it is another than `name`.
};

using ChoiceMember = ChoiceOf<Options>;
using OptionMember = MemberOf<Options>;
using OptionInfo = OptionOf<Options>;
using GeometryOption = OptionOf<GeometryOptions>;
using LayerOption = OptionOf<LayerOptions>;

/// All options, in the order of the help and of the documentation.
std::span<const OptionInfo> option_table();
/// The same for a geometry.
std::span<const GeometryOption> geometry_option_table();
/// The same for layers.
std::span<const LayerOption> layer_option_table();

/// The default as a user would write it, such as "1e-6", "on" or "straight-sided"; empty for a list, a field or an
/// option with an opposite, whose help says it.
template <class Of>
std::string default_text(const OptionOf<Of>& option);

/// Whether the option speaks of an energy, of its constants, or of where and how to stop at its optimum. Whoever names
/// such an option and no objective gets the energy's optimum.
bool is_of_energy(const OptionInfo& option);
/// Whether the option is a number, a whole number or a choice, and has its default.
bool is_default(const OptionInfo& option, const Options& options);

/// Whether the value is a number or a whole number.
template <class Of>
bool is_number(const OptionOf<Of>& option);
/// The value of an option that is a number; NaN for other types.
template <class Of>
double number_of(const OptionOf<Of>& option, const Of& options);
/// The shortest text that means the number, such as "1e-6", "0.25" or "nan".
std::string number_text(double value);

}  // namespace varimesh
