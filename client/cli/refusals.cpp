// The parser tells what is wrong only in its text, so its texts are recognised here. One that is not known stays as it
// is; the tests see to it that the usual ones are known.
#include "client/cli/refusals.h"

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <variant>

#include "client/cli/names.h"
#include "client/cli/option_flags.h"
#include "core/command_line/facts.h"
#include "core/options/nearest_word.h"
#include "core/options/option_table.h"

namespace varimesh::client {
namespace {

/// A text that was taken apart at a separator.
struct Halves {
  std::string before, after;
  bool found = false;
};

Halves split(const std::string& text, const std::string& separator) {
  const std::size_t at = text.find(separator);
  if (at == std::string::npos) return {text, "", false};
  return {text.substr(0, at), text.substr(at + separator.size()), true};
}

/// The flag or argument of this name; null if there is none.
const CLI::Option* option_of(const CLI::App& program, const std::string& name) {
  const auto used = program.get_subcommands();
  return (used.empty() ? program : *used.front()).get_option_no_throw(name);
}

/// The placeholder of a flag's value, without what the parser adds about its range: "LENGTH:POSITIVE" is "LENGTH".
std::string placeholder(const CLI::Option& option) { return split(option.get_type_name(), ":").before; }

/// What an option of the optimisation may be, such as "a whole number: 1 to 10".
std::string number_wanted(const std::string& flag) {
  const auto wanted = [&]<class Of>(std::span<const OptionOf<Of>> table) -> std::string {
    for (const OptionOf<Of>& option : table)
      if (std::holds_alternative<std::vector<double> Of::*>(option.member) && flag_of(option) == flag)
        return "numbers with commas between them";
      else if (is_number(option) && flag_of(option) == flag)
        return (std::holds_alternative<int Of::*>(option.member) ? "a whole number: " : "a number: ") +
               std::string(option.values);
    return {};
  };
  for (const std::string& text :
       {wanted(option_table()), wanted(geometry_option_table()), wanted(layer_option_table())})
    if (!text.empty()) return text;
  return "a number";
}

/// "Value 0 not in range 0.000000 to 45.000000", or from CLI11 2.4 on "Value 0 not in range [0 - 45]".
std::string outside(const CLI::Option& option, const std::string& name, const std::string& what) {
  const Halves value = split(what.substr(sizeof "Value " - 1), " not in range ");
  const Halves ends = value.after.starts_with('[') ? split(value.after.substr(1), " - ") : split(value.after, " to ");
  const double least = std::strtod(ends.before.c_str(), nullptr), most = std::strtod(ends.after.c_str(), nullptr);
  constexpr double kNoEnd = 1e300;
  const bool may_be_least = option.get_type_name().find("POSITIVE") == std::string::npos;
  const std::string range = most < kNoEnd  ? "a number from " + number_text(least) + " to " + number_text(most)
                            : may_be_least ? "a number that is " + number_text(least) + " or more"
                                           : "a number above 0";
  return name + " is " + value.before + "; give " + range + ".";
}

std::string invalid(const CLI::App& program, const std::string& text) {
  const auto [name, what, has_name] = split(text, ": ");
  const CLI::Option* option = has_name ? option_of(program, name) : nullptr;
  if (option == nullptr) return text;
  if (what.starts_with("Value ") && what.find(" not in range ") != std::string::npos)
    return outside(*option, name, what);
  const auto [word, set, has_set] = split(what, " not in {");
  if (!has_set || !set.ends_with('}')) return text;
  return name + ": " + no_such_word(word, CLI::detail::split(set.substr(0, set.size() - 1), ','));
}

std::string missing(const CLI::App& program, const std::string& text) {
  const auto [name, rest, found] = split(text, " is required");
  if (name == "A subcommand") return "a command is missing, such as 'varimesh optimise IN -o OUT'.";
  const CLI::Option* option = found && rest.empty() ? option_of(program, name) : nullptr;
  if (option == nullptr) return text;
  const bool is_argument = !name.starts_with('-');
  return (is_argument ? placeholder(*option) + " is missing: " : name + " is required: ") + option->get_description() +
         ".";
}

std::string unreadable(const std::string& text) {
  const Halves rest = split(text, "Could not convert: ");
  const auto [name, value, has_value] = split(rest.after, " = ");
  if (!rest.found || !has_value) return text;
  return name + " is '" + value + "'; give " + number_wanted(name) + ".";
}

std::string without_value(const CLI::App& program, const std::string& text) {
  const auto [name, rest, found] = split(text, ": ");
  const CLI::Option* option = found && rest.ends_with(" missing") ? option_of(program, name) : nullptr;
  if (option == nullptr) return text;
  return name + " has no value; write " + name + " " + placeholder(*option) + ".";
}

}  // namespace

std::string no_such_word(const std::string& word, const std::vector<std::string>& known) {
  const std::string near = nearest_word(word, known);
  return "there is no '" + word + "'; " +
         (near.empty() ? "choose one of " : "did you mean '" + near + "'? The choices are ") + joined(known, ", ") +
         ".";
}

std::string refusal_text(const CLI::App& program, const CLI::ParseError& error) {
  const std::string text = error.what();
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) return missing(program, text);
  if (dynamic_cast<const CLI::ConversionError*>(&error) != nullptr) return unreadable(text);
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr) return without_value(program, text);
  if (dynamic_cast<const CLI::ValidationError*>(&error) != nullptr) return invalid(program, text);
  return text;
}

}  // namespace varimesh::client
