#include "client/cli/help.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "client/cli/command_facts.h"
#include "core/command_line/columns.h"
#include "core/command_line/help.h"
#include "core/options/nearest_word.h"

namespace varimesh::client {
namespace {

/// The commands with so many flags that nobody reads all of them at first, and the flags that most people need.
constexpr std::array<std::string_view, 3> kBriefCommands = {"optimise", "curve", "submit"};
constexpr std::array<std::string_view, 18> kCommonFlags = {
    "--help",   "--help-all", "--output",     "--report",   "--output-format", "--label",
    "--server", "--json",     "--quiet",      "--geometry", "--into",          "--objective",
    "--until",  "--order",    "--time-limit", "--threads",  "--fix",           "--priority"};

/// `command` prints the list of all words that would be right.
std::string with_suggestion(const std::string& sentence, const std::string& suggestion, const std::string& command) {
  return sentence + (suggestion.empty() ? "; " + command + " lists them." : "; did you mean '" + suggestion + "'?");
}

bool is_common(const FlagFacts& flag) {
  return flag.argument || flag.required || std::ranges::any_of(flag.names, [](const std::string& name) {
           return std::ranges::find(kCommonFlags, name) != kCommonFlags.end();
         });
}

}  // namespace

bool has_brief_help(const std::string& command) {
  return std::ranges::find(kBriefCommands, command) != kBriefCommands.end();
}

std::string unknown_word(const CLI::App& program, const std::vector<std::string>& words) {
  if (words.empty()) return "";
  const auto commands = subcommand_facts(program);
  const CommandFacts* command = nullptr;
  std::vector<std::string> names;
  for (const CommandFacts& one : commands) {
    names.push_back(one.name);
    if (one.name == words[0]) command = &one;
  }
  const CommandFacts root = facts_of(program);
  std::vector<std::string> flags;
  for (const FlagFacts& flag : (command == nullptr ? root : *command).flags)
    if (!flag.argument) flags.insert(flags.end(), flag.names.begin(), flag.names.end());
  if (command == nullptr && words[0].rfind('-', 0) != 0)
    return with_suggestion("there is no command '" + words[0] + "'", nearest_word(words[0], names), "varimesh --help");
  for (const std::string& word : words) {
    if (word == "--") break;
    if (word.rfind("--", 0) != 0) continue;
    const std::string flag = word.substr(0, word.find('='));
    if (std::find(flags.begin(), flags.end(), flag) == flags.end())
      return with_suggestion("there is no option '" + flag + "'", nearest_word(flag, flags),
                             "varimesh " + (command == nullptr ? "" : command->name + " ") +
                                 (command != nullptr && has_brief_help(command->name) ? "--help-all" : "--help"));
  }
  return "";
}

std::string Help::make_help(const CLI::App* command, std::string, CLI::AppFormatMode mode) const {
  const std::size_t width = width_ > 0 ? static_cast<std::size_t>(width_) : help_width();
  const CLI::App* program = command;
  while (program->get_parent() != nullptr) program = program->get_parent();
  const CommandFacts facts = facts_of(*command);
  const bool is_brief = mode != CLI::AppFormatMode::All && has_brief_help(facts.name);
  return help_text(program_facts(*program), facts, width,
                   is_brief ? is_common : std::function<bool(const FlagFacts&)>());
}

}  // namespace varimesh::client
