// What is wrong with a command line, in this program's own words.
#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
class ParseError;
}  // namespace CLI

namespace varimesh::client {

/// Says that a word is not among those that are possible, and which of them was meant or what they are.
std::string no_such_word(const std::string& word, const std::vector<std::string>& known);

/// What the parser found wrong, as a sentence that says where it is and what to give. `program` has been parsed as far
/// as the error.
std::string refusal_text(const CLI::App& program, const CLI::ParseError& error);

}  // namespace varimesh::client
