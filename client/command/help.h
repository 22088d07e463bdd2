// --help with examples first, and what was probably meant where a word is misspelt.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace varimesh::client {

/// Lays out the help of the program and of its commands. Goes into the program before commands are added.
class Help : public CLI::FormatterBase {
 public:
  /// `width` in characters; 0: that of the terminal, or 100.
  explicit Help(int width = 0) : width_(width) {}
  std::string make_help(const CLI::App* command, std::string name, CLI::AppFormatMode mode) const override;

 private:
  const int width_;
};

/// A sentence about the first word of a command line that is no command or flag, with what was probably meant; empty
/// where all are known. `words` come after the program's name.
std::string unknown_word(const CLI::App& program, const std::vector<std::string>& words);

}  // namespace varimesh::client
