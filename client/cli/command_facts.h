// The commands and their flags, read from the parser itself. The help, the manual, completion and suggestions are all
// made from this, so they agree with what is parsed.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace CLI {
class App;
}

namespace varimesh::client {

/// A command line to copy. HOST:PORT stands for a server, JOB for the name of a job.
struct Example {
  std::string_view command;  ///< The subcommand; empty: the program.
  std::string_view what;     ///< What the line does.
  std::string_view line;
};

/// The examples of all commands.
std::span<const Example> all_examples();

/// A flag or a positional argument.
struct FlagFacts {
  std::vector<std::string> names;    ///< For a flag "-o" and "--output"; for an argument its placeholder, "IN".
  std::string value;                 ///< The placeholder of a flag's value, "OUT"; empty: the flag has no value.
  std::vector<std::string> choices;  ///< All possible values; empty: they are not listed.
  std::string help;
  std::string group;      ///< The heading under which the help lists it.
  bool argument = false;  ///< A positional argument.
  bool file = false;      ///< The value is the name of a file.
  bool required = false;
  bool repeated = false;  ///< The flag may be given several times.
};

/// A subcommand or the program itself.
struct CommandFacts {
  std::string name;  ///< Empty: the program.
  std::string purpose;
  std::vector<Example> examples;
  std::vector<FlagFacts> flags;
};

/// The facts of a subcommand or of the program.
CommandFacts facts_of(const CLI::App& command);
/// The facts of all subcommands, in the order of the help.
std::vector<CommandFacts> subcommand_facts(const CLI::App& program);

}  // namespace varimesh::client
