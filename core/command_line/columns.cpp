#include "core/command_line/columns.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

namespace varimesh {
namespace {

constexpr std::size_t kMeaningColumn = 26;  ///< Where the meanings of terms begin.

/// The number of characters of UTF-8 text; bytes that continue a character are not counted.
std::size_t length(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

}  // namespace

std::size_t help_width() {
  winsize size{};
  if (isatty(STDOUT_FILENO) == 1 && ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0)
    return std::clamp<std::size_t>(size.ws_col, 60, 120);
  return 100;
}

std::string wrapped(const std::string& text, std::size_t at, std::size_t column, std::size_t width) {
  std::string out;
  std::size_t from = 0;
  bool first = true;
  while (from < text.size()) {
    const std::size_t end = std::min(text.find(' ', from), text.size());
    const std::string word = text.substr(from, end - from);
    from = end + 1;
    if (at < column) {
      out += std::string(column - at, ' ');
      at = column;
    } else if (!first && at + 1 + length(word) > width) {
      out += "\n" + std::string(column, ' ');
      at = column;
    } else if (!first) {
      out += ' ';
      ++at;
    }
    out += word;
    at += length(word);
    first = false;
  }
  return out + "\n";
}

std::string help_entry(const std::string& term, const std::string& meaning, std::size_t width) {
  const std::string start = "  " + term;
  if (length(start) + 2 > kMeaningColumn) return start + "\n" + wrapped(meaning, 0, kMeaningColumn, width);
  return start + wrapped(meaning, length(start), kMeaningColumn, width);
}

std::string troff_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else
      out += c;
  }
  return !out.empty() && (out[0] == '.' || out[0] == '\'') ? "\\&" + out : out;
}

std::string troff_item(const std::string& term, std::string_view meaning) {
  return ".TP\n" + term + "\n" + troff_text(meaning) + "\n";
}

std::string troff_example(std::string_view what, std::string_view line) {
  return ".PP\n" + troff_text(what) + "\n.PP\n.RS\n.nf\n" + troff_text(line) + "\n.fi\n.RE\n";
}

}  // namespace varimesh
