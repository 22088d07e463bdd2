// Reads the facts of a command line from the parser itself. Its header takes seconds to compile, so one file of each
// program includes this.
#pragma once

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <functional>
#include <string>
#include <vector>

#include "core/command_line/facts.h"

namespace varimesh {

/// The facts of a flag or an argument, without its choices. Its value is a placeholder such as OUT if it was given one,
/// or else N for a number and TEXT for anything else.
inline FlagFacts parsed_facts(const CLI::Option& option) {
  FlagFacts facts;
  facts.argument = option.get_positional();
  // After a colon, the type's name goes on with the checks.
  if (option.get_type_size() != 0) facts.value = option.get_type_name().substr(0, option.get_type_name().find(':'));
  if (facts.value == "INT" || facts.value == "UINT" || facts.value == "FLOAT") facts.value = "N";
  if (facts.argument) {
    facts.names = {facts.value == "TEXT" || facts.value == "text" ? option.get_name(true) : facts.value};
    std::ranges::transform(facts.names[0], facts.names[0].begin(), ::toupper);
  } else {
    for (const std::string& name : option.get_snames()) facts.names.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) facts.names.push_back("--" + name);
  }
  facts.help = option.get_description();
  facts.group = option.get_group();
  constexpr std::array files{"IN", "OUT", "MESH", "DIR"};
  facts.file = facts.value.starts_with("FILE") || std::ranges::find(files, facts.value) != files.end();
  facts.required = option.get_required();
  facts.repeated = option.get_expected_max() > 1 && !facts.argument;
  return facts;
}

/// The facts of a subcommand or of the program, with its examples among all. `of`: the facts of a flag.
inline CommandFacts parsed_facts(const CLI::App& command, std::span<const Example> examples,
                                 const std::function<FlagFacts(const CLI::Option&)>& of) {
  CommandFacts facts;
  if (command.get_parent() != nullptr) facts.name = command.get_name();
  facts.purpose = command.get_description();
  for (const Example& example : examples)
    if (example.command == facts.name) facts.examples.push_back(example);
  for (const CLI::Option* option : command.get_options()) facts.flags.push_back(of(*option));
  return facts;
}

/// The same for all subcommands.
inline std::vector<CommandFacts> parsed_subcommands(const CLI::App& program, std::span<const Example> examples,
                                                    const std::function<FlagFacts(const CLI::Option&)>& of) {
  std::vector<CommandFacts> all;
  for (const CLI::App* command : program.get_subcommands([](const CLI::App*) { return true; }))
    all.push_back(parsed_facts(*command, examples, of));
  return all;
}

}  // namespace varimesh
