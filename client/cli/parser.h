// The flags and arguments of the commands. Only the files of client/cli include the headers of the parser, CLI11,
// because each file that includes them takes about eight seconds longer to compile.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "core/base/error.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace varimesh::client {

/// Where the value of a flag goes. A flag with a bool has no value, and one with a vector may be given several times. A
/// function is called with the text of the value.
using Target = std::variant<bool*, int*, std::int64_t*, double*, std::string*, std::filesystem::path*,
                            std::vector<std::string>*, std::function<void(const std::string&)>>;

/// A flag or an argument of a command. The functions say more about it and return it.
class Flag {
 public:
  explicit Flag(CLI::Option* option) : option_(option) {}

  Flag& value(const std::string& placeholder);  ///< What the help calls the value.
  Flag& help(const std::string& text);          ///< Replaces the text of the help.
  Flag& group(const std::string& heading);      ///< The heading under which the help lists the flag.
  Flag& required();
  Flag& needs(const std::string& other);
  Flag& excludes(const std::string& other);
  Flag& from_environment(const std::string& variable);  ///< The value if the flag is not given.
  Flag& one_value_each();                               ///< A flag with a vector takes one value each time.
  Flag& shows_default();

  /// These accept only some values.
  Flag& from(int least, int most);
  Flag& from(double least, double most);
  Flag& positive();
  Flag& not_negative();
  Flag& one_of(const std::vector<std::string>& words);
  Flag& utf8();                ///< Nothing else can be sent.
  Flag& or_standard_input();   ///< A file, or "-" for standard input.
  Flag& or_standard_output();  ///< Files, or "-" for standard output.

 private:
  CLI::Option* option_;
};

/// The program or one of its commands, to add flags to.
class Command {
 public:
  Command(CLI::App& app) : app_(&app) {}  // NOLINT(google-explicit-constructor): a command is its parser

  /// Gives the program its name, its purpose, --help and --version. It cannot be run without a subcommand.
  void describe(const std::string& name, const std::string& purpose, const std::string& version);
  Command add_command(const std::string& name, const std::string& purpose);
  void alias(const std::string& name);

  /// `names` is "-o,--output" for a flag, and a name without dashes for an argument.
  Flag add(const std::string& names, const Target& target, const std::string& help);
  /// The flag or argument of this name, which must exist.
  Flag operator[](const std::string& name) const;

  /// Calls `check` when all flags of this command have been read. An error refuses the command line.
  void at_end(const std::function<Expected<void>()>& check);

  CLI::App& app() const { return *app_; }

 private:
  CLI::App* app_;
};

/// Carries out a command and returns the exit status.
using Action = std::function<int()>;
/// The commands by their names.
using Actions = std::vector<std::pair<std::string, Action>>;

/// Parses a command line and carries out its command. Prints the help, the version, or what is wrong with the command
/// line. Returns the exit status.
///
/// @param add adds all commands to the program and returns them
int run_command_line(int argc, char** argv, const std::function<Actions(Command)>& add);

}  // namespace varimesh::client
