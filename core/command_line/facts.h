// The facts of a program's command line. Help, manual pages and completion are made from these alone, so they agree
// with each other. The program takes the facts from its parser, so they also agree with what it parses.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace varimesh {

/// A command line to copy. HOST:PORT stands for a server, JOB for the name of a job.
struct Example {
  std::string_view command;  ///< The subcommand; empty: the program.
  std::string_view what;     ///< What the line does.
  std::string_view line;
};

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

/// An exit status in words.
struct ExitStatusMeaning {
  int status;
  std::string_view meaning;
};

struct ProgramFacts {
  std::string name;
  CommandFacts itself;
  std::vector<CommandFacts> commands;  ///< In the order of the help.
  bool needs_command = false;          ///< The program does nothing without a command.
  std::span<const ExitStatusMeaning> exit_statuses = {};
  /// The section of the manual, with its title, and the pages of other programs that one should see, as troff.
  int section = 1;
  std::string_view section_title = "User Commands";
  std::string_view see_also = "";
};

/// The words with `separator` between them.
std::string joined(const std::vector<std::string>& words, std::string_view separator);

}  // namespace varimesh
