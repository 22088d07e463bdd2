#include "core/command_line/help.h"

#include <algorithm>
#include <utility>

#include "core/command_line/columns.h"

namespace varimesh {
namespace {

std::string entry(const FlagFacts& flag, std::size_t width) {
  std::string name = joined(flag.names, ", ");
  if (!flag.argument && !flag.value.empty()) name += " " + flag.value;
  std::string help = flag.help;
  if (flag.required && !flag.argument) help += " (required)";
  return help_entry(name, help, width);
}

/// The line after "Usage:".
std::string usage(const ProgramFacts& program, const CommandFacts& facts) {
  const bool is_program = facts.name.empty();
  std::string line = program.name + (is_program ? "" : " " + facts.name);
  if (!is_program || !program.needs_command) line += " [OPTIONS]";
  if (is_program && !program.commands.empty()) line += program.needs_command ? " COMMAND" : " [COMMAND]";
  for (const FlagFacts& flag : facts.flags)
    if (flag.argument) line += flag.required ? " " + flag.names[0] : " [" + flag.names[0] + "]";
  return line + "\n";
}

/// The positional arguments, and the flags under the headings of their groups.
std::string arguments_and_flags(const ProgramFacts& program, const CommandFacts& facts, std::size_t width,
                                const std::function<bool(const FlagFacts&)>& is_shown) {
  std::string arguments;
  std::size_t more = 0;
  std::vector<std::pair<std::string, std::string>> groups;
  for (const FlagFacts& flag : facts.flags) {
    if (is_shown && !is_shown(flag)) {
      ++more;
      continue;
    }
    if (flag.argument) {
      arguments += entry(flag, width);
      continue;
    }
    auto group = std::ranges::find_if(groups, [&](const auto& one) { return one.first == flag.group; });
    if (group == groups.end()) group = groups.insert(groups.end(), {flag.group, ""});
    group->second += entry(flag, width);
  }
  std::string out = arguments.empty() ? "" : "\nArguments:\n" + arguments;
  for (const auto& [name, entries] : groups) out += "\n" + name + ":\n" + entries;
  if (more > 0)
    out += "\n" + std::to_string(more) + " more options: " + program.name + " " + facts.name + " --help-all\n";
  return out;
}

}  // namespace

std::string help_text(const ProgramFacts& program, const CommandFacts& facts, std::size_t width,
                      const std::function<bool(const FlagFacts&)>& is_shown) {
  std::string out = wrapped(facts.purpose, 0, 0, width);
  if (!facts.examples.empty()) out += "\nExamples:\n";
  for (const Example& example : facts.examples)
    out += "  # " + std::string(example.what) + "\n  " + std::string(example.line) + "\n";

  out += "\nUsage: " + usage(program, facts);
  const bool is_program = facts.name.empty();
  if (is_program && !program.commands.empty())
    out += program.needs_command ? "\nCommands:\n" : "\nCommands, whose --help says more:\n";
  if (is_program)
    for (const CommandFacts& one : program.commands) out += help_entry(one.name, one.purpose, width);
  out += arguments_and_flags(program, facts, width, is_shown);
  if (!is_program || program.exit_statuses.empty()) return out;
  out += "\nExit status:\n";
  for (const ExitStatusMeaning& one : program.exit_statuses)
    out += help_entry(std::to_string(one.status), std::string(one.meaning), width);
  return out;
}

}  // namespace varimesh
