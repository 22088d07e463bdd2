// Space in text as the readers of files see it.
#pragma once

#include <string_view>

namespace varimesh {

/// Whether a byte separates words: space, tabs, ends of lines and everything below them.
constexpr bool is_space(char c) { return static_cast<unsigned char>(c) <= ' '; }

/// The text without space at its end.
constexpr std::string_view without_space_behind(std::string_view text) {
  while (!text.empty() && is_space(text.back())) text.remove_suffix(1);
  return text;
}

/// The text without space at both ends.
constexpr std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
  return without_space_behind(text);
}

}  // namespace varimesh
