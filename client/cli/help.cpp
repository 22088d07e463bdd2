#include "client/cli/help.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "client/cli/command_facts.h"
#include "client/cli/names.h"
#include "client/process/exit_status.h"
#include "core/options/nearest_word.h"

namespace varimesh::client {
namespace {

/// The commands with so many flags that nobody reads all of them at first, and the flags that most people need.
constexpr std::array<std::string_view, 3> kBriefCommands = {"optimise", "curve", "submit"};
constexpr std::array<std::string_view, 20> kCommonFlags = {
    "--help",  "--help-all",   "--output",      "--report",   "--output-format", "--label",     "--server",
    "--json",  "--quiet",      "--geometry",    "--slide-on", "--layers",        "--objective", "--until",
    "--order", "--time-limit", "--merge-nodes", "--threads",  "--fix",           "--priority"};

constexpr std::size_t kMeaningColumn = 26;  ///< Where the meanings of terms begin.

/// The number of characters of UTF-8 text; bytes that continue a character are not counted.
std::size_t length(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::size_t terminal_width() {
  winsize size{};
  if (isatty(STDOUT_FILENO) == 1 && ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0)
    return std::clamp<std::size_t>(size.ws_col, 60, 120);
  return 100;
}

/// Wraps text into lines from `column` to `width`. The first line has `at` characters already.
std::string wrapped(const std::string& text, std::size_t at, std::size_t column, std::size_t width) {
  std::string out;
  std::size_t from = 0;
  bool first = true;
  while (from < text.size()) {
    const std::size_t end = std::min(text.find(' ', from), text.size());
    const std::string word = text.substr(from, end - from);
    from = end + 1;
    if (at < column) {
      out += std::string(column - at, ' ');
      at = column;
    } else if (!first && at + 1 + length(word) > width) {
      out += "\n" + std::string(column, ' ');
      at = column;
    } else if (!first) {
      out += ' ';
      ++at;
    }
    out += word;
    at += length(word);
    first = false;
  }
  return out + "\n";
}

/// A term and its meaning, in two columns.
std::string entry(const std::string& term, const std::string& meaning, std::size_t width) {
  const std::string start = "  " + term;
  if (length(start) + 2 > kMeaningColumn) return start + "\n" + wrapped(meaning, 0, kMeaningColumn, width);
  return start + wrapped(meaning, length(start), kMeaningColumn, width);
}

std::string entry(const FlagFacts& flag, std::size_t width) {
  std::string name = joined(flag.names, ", ");
  if (!flag.argument && !flag.value.empty()) name += " " + flag.value;
  std::string help = flag.help;
  if (flag.required && !flag.argument) help += " (required)";
  return entry(name, help, width);
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
  const std::size_t width = width_ > 0 ? static_cast<std::size_t>(width_) : terminal_width();
  const CommandFacts facts = facts_of(*command);
  const auto commands = subcommand_facts(*command);
  std::string out = wrapped(facts.purpose, 0, 0, width) + "\nExamples:\n";
  for (const Example& example : facts.examples) out += fmt::format("  # {}\n  {}\n", example.what, example.line);

  out += "\nUsage: " + usage(facts, !commands.empty());
  if (!commands.empty()) out += "\nCommands:\n";
  for (const CommandFacts& one : commands) out += entry(one.name, one.purpose, width);
  out += arguments_and_flags(facts, width, mode == CLI::AppFormatMode::All || !has_brief_help(facts.name));
  if (!commands.empty()) {
    out += "\nExit status:\n";
    for (const ExitStatusMeaning& one : exit_statuses())
      out += entry(std::to_string(one.status), std::string(one.meaning), width);
  }
  return out;
}

}  // namespace varimesh::client
