// The settings of varimeshd beside its command line: the environment and a file. The options of the command line are
// the one table of all three.
#pragma once

#include <string>
#include <vector>

#include "core/base/error.h"

namespace CLI {
class App;
}

namespace varimesh::server {

/// Arguments of the command line, "--key=value", by where they come from.
struct GivenSettings {
  std::string file;  ///< The configuration file. Empty: none.
  std::vector<std::string> from_file;
  std::vector<std::string> from_environment;
  std::vector<std::string> from_command_line;  ///< As they were written, without the name of the program.

  /// All of them; a later one wins over an earlier one.
  std::vector<std::string> all() const;
};

/// Lets the later of two values win, for every option of the program.
void let_later_values_win(CLI::App& app);

/// Reads the configuration file (--config FILE, or VARIMESHD_CONFIG) and the environment (VARIMESHD_KEY, with the key
/// in capitals and _ for -). A line of the file is "key = value", with the keys of the command line without dashes;
/// "#" begins a comment. A value may stand in quotation marks, of which two stand for one in the value. Errors:
/// BadOption for a file that cannot be read, for a value with a line break, and for a key that is none, with the one
/// that may be meant.
Expected<GivenSettings> gather_settings(const CLI::App& app, int argc, const char* const* argv);

/// The settings of a program that has parsed them, in the form of a configuration file: those that were given, and
/// where, and as comments those that were not, with their defaults.
std::string print_settings(const CLI::App& app, const GivenSettings& given);

}  // namespace varimesh::server
