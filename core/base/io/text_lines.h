// Reads text that users write by hand: lines of words, with comments. For lists of displacements and target fields.
#pragma once

#include <charconv>
#include <cstddef>
#include <string_view>
#include <system_error>

namespace varimesh {

/// Removes the first word from a line and returns it; empty if no word is left.
inline std::string_view next_word(std::string_view& line) {
  const std::size_t start = line.find_first_not_of(" \t\r");
  if (start == std::string_view::npos) return line = {};
  const std::size_t end = line.find_first_of(" \t\r", start);
  const std::string_view word = line.substr(start, end == std::string_view::npos ? end : end - start);
  line = end == std::string_view::npos ? std::string_view{} : line.substr(end);
  return word;
}

/// Removes lines from a text up to and including the first that is not blank, and stores that one in `line`. A comment,
/// from # to the end of the line, is dropped and counts as blank. Adds the number of lines removed to `number`. Returns
/// false at the end of the text.
inline bool next_line(std::string_view& text, std::string_view& line, std::size_t& number) {
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    line = text.substr(0, end);
    text = end == std::string_view::npos ? std::string_view{} : text.substr(end + 1);
    line = line.substr(0, line.find('#'));
    ++number;
    if (line.find_first_not_of(" \t\r") != std::string_view::npos) return true;
  }
  return false;
}

/// Converts a word to a number. Returns false if the word as a whole is not a number.
template <class T>
bool parse(std::string_view word, T& value) {
  if (!word.empty() && word.front() == '+') word.remove_prefix(1);
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && stop == word.data() + word.size();
}

}  // namespace varimesh
