#include "client/cli/help.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "client/cli/command_facts.h"
#include "client/cli/names.h"
#include "client/process/exit_status.h"
#include "core/options/help_text.h"
#include "core/options/nearest_word.h"

namespace varimesh::client {
namespace {

/// The commands with so many flags that nobody reads all of them at first, and the flags that most people need.
constexpr std::array<std::string_view, 3> kBriefCommands = {"optimise", "curve", "submit"};
constexpr std::array<std::string_view, 20> kCommonFlags = {
    "--help",  "--help-all",   "--output",      "--report",   "--output-format", "--label",     "--server",
    "--json",  "--quiet",      "--geometry",    "--slide-on", "--into",          "--objective", "--until",
    "--order", "--time-limit", "--merge-nodes", "--threads",  "--fix",           "--priority"};

std::string entry(const FlagFacts& flag, std::size_t width) {
  std::string name = joined(flag.names, ", ");
  if (!flag.argument && !flag.value.empty()) name += " " + flag.value;
  std::string help = flag.help;
  if (flag.required && !flag.argument) help += " (required)";
  return help_entry(name, help, width);
}

/// `command` prints the list of all words that would be right.
std::string with_suggestion(const std::string& sentence, const std::string& suggestion, const std::string& command) {
  return sentence + (suggestion.empty() ? "; " + command + " lists them." : "; did you mean '" + suggestion + "'?");
}

/// The line after "Usage:".
std::string usage(const CommandFacts& facts, bool has_commands) {
  std::string line = "varimesh" + (facts.name.empty() ? "" : " " + facts.name);
  line += has_commands ? " COMMAND" : " [OPTIONS]";
  for (const FlagFacts& flag : facts.flags)
    if (flag.argument) line += flag.required ? " " + flag.names[0] : " [" + flag.names[0] + "]";
  return line + "\n";
}

bool is_common(const FlagFacts& flag) {
  return flag.argument || flag.required || std::ranges::any_of(flag.names, [](const std::string& name) {
           return std::ranges::find(kCommonFlags, name) != kCommonFlags.end();
         });
}

/// The positional arguments, and the flags under the headings of their groups. `all`: also those that few need;
/// otherwise a last line says where they are.
std::string arguments_and_flags(const CommandFacts& facts, std::size_t width, bool all) {
  std::string arguments;
  std::size_t more = 0;
  std::vector<std::pair<std::string, std::string>> groups;
  for (const FlagFacts& flag : facts.flags) {
    if (!all && !is_common(flag)) {
      ++more;
      continue;
    }
    if (flag.argument) {
      arguments += entry(flag, width);
      continue;
    }
    auto group = std::find_if(groups.begin(), groups.end(), [&](const auto& one) { return one.first == flag.group; });
    if (group == groups.end()) group = groups.insert(groups.end(), {flag.group, ""});
    group->second += entry(flag, width);
  }
  std::string out = arguments.empty() ? "" : "\nArguments:\n" + arguments;
  for (const auto& [name, entries] : groups) out += fmt::format("\n{}:\n{}", name, entries);
  if (more > 0) out += fmt::format("\n{} more options: varimesh {} --help-all\n", more, facts.name);
  return out;
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
  const CommandFacts facts = facts_of(*command);
  const auto commands = subcommand_facts(*command);
  std::string out = wrapped(facts.purpose, 0, 0, width) + "\nExamples:\n";
  for (const Example& example : facts.examples) out += fmt::format("  # {}\n  {}\n", example.what, example.line);

  out += "\nUsage: " + usage(facts, !commands.empty());
  if (!commands.empty()) out += "\nCommands:\n";
  for (const CommandFacts& one : commands) out += help_entry(one.name, one.purpose, width);
  out += arguments_and_flags(facts, width, mode == CLI::AppFormatMode::All || !has_brief_help(facts.name));
  if (!commands.empty()) {
    out += "\nExit status:\n";
    for (const ExitStatusMeaning& one : exit_statuses())
      out += help_entry(std::to_string(one.status), std::string(one.meaning), width);
  }
  return out;
}

}  // namespace varimesh::client
