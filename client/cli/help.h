// The text of --help, and suggestions for misspelt words.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace varimesh::client {

/// Whether --help of this command shows only the flags that most people need, and --help-all shows all.
bool has_brief_help(const std::string& command);

/// Formats the help of the program and of its commands, examples first. Install it before commands are added.
class Help : public CLI::FormatterBase {
 public:
  /// `width` is in characters; 0 stands for the width of the terminal, or 100 without a terminal.
  explicit Help(int width = 0) : width_(width) {}
  std::string make_help(const CLI::App* command, std::string name, CLI::AppFormatMode mode) const override;

 private:
  const int width_;
};

/// Looks for a word that the program does not know, such as a misspelt command or flag. Returns a sentence about the
/// first one, with a suggestion if a known word is like it; empty if all are known. `words`: the command line without
/// the program's name.
std::string unknown_word(const CLI::App& program, const std::vector<std::string>& words);

}  // namespace varimesh::client
