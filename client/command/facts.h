// What a command and its flags are, read from the parser that takes them: help, man pages, completion and suggestions
// are made from this, and cannot say anything else than what is parsed.
#pragma once

#include <CLI/CLI.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace varimesh::client {

/// A line to copy. HOST:PORT and JOB stand for a server and a job's name.
struct Example {
  std::string_view command;  ///< The subcommand; empty: the program.
  std::string_view what;
  std::string_view line;
};

std::span<const Example> all_examples();

/// A flag, or an argument without one.
struct FlagFacts {
  std::vector<std::string> names;    ///< "-o", "--output"; of an argument what stands for it: "IN".
  std::string value;                 ///< What stands for the value: "OUT"; empty: it has none.
  std::vector<std::string> choices;  ///< All values there are, where they are known.
  std::string help;
  std::string group;
  bool argument = false;
  bool file = false;  ///< The value is a file's name.
  bool required = false;
  bool repeated = false;
};

struct CommandFacts {
  std::string name;  ///< Empty: the program itself.
  std::string purpose;
  std::vector<Example> examples;
  std::vector<FlagFacts> flags;
};

/// Of one command, or of the program.
CommandFacts facts_of(const CLI::App& command);
/// Of all subcommands, in their order.
std::vector<CommandFacts> subcommand_facts(const CLI::App& program);

/// What the exit statuses mean, a line each.
std::span<const std::string_view> exit_statuses();

}  // namespace varimesh::client
