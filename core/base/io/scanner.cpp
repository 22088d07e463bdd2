// The parts of the scanner that are not called for every number.
#include "core/base/io/scanner.h"

#include <algorithm>

#include "core/base/io/text.h"

namespace varimesh {

namespace {

// A token as error messages show it: short, and without bytes that could disturb a terminal.
std::string shown(std::string_view token) {
  std::string text;
  for (char c : token.substr(0, 24)) text += (c > ' ' && c < 127) ? c : '?';
  return token.size() > 24 ? text + "..." : text;
}

}  // namespace

std::string_view Scanner::line() {
  const char* stop = std::find(at_, end_, '\n');
  const std::string_view text = without_space_behind({at_, std::size_t(stop - at_)});
  at_ = stop < end_ ? stop + 1 : end_;
  return text;
}

std::string_view Scanner::until_line(std::string_view text, bool& found) {
  const std::string_view rest(at_, left());
  std::size_t from = 0;
  while ((from = rest.find(text, from)) != std::string_view::npos) {
    const bool starts = from == 0 || rest[from - 1] == '\n';
    const std::size_t stop = from + text.size();
    const bool ends = stop == rest.size() || rest[stop] == '\n' || rest[stop] == '\r' || rest[stop] == ' ';
    if (starts && ends) {
      found = true;
      at_ += from;
      return rest.substr(0, from);
    }
    from = stop;
  }
  found = false;
  return {};
}

std::int64_t Scanner::count(const char* what, std::size_t least, bool as_text) {
  const std::int64_t value = as_text ? text_integer(what) : size(what);
  if (value < 0) fail(std::string(what) + " is negative");
  if (value > std::numeric_limits<std::int32_t>::max())
    fail(std::string(what) + ", " + std::to_string(value) + ", exceeds 2147483647, the most that a mesh may have");
  if (std::size_t(value) > left() / least + 1)
    fail_truncated(("everything that " + std::string(what) + ", " + std::to_string(value) + ", announces").c_str());
  return value;
}

std::string Scanner::place() const {
  std::string text = section.empty() ? "" : "in $" + section + ", ";
  if (!binary) text += "line " + std::to_string(1 + std::count(begin_, at_, '\n')) + ", ";
  return text + "byte " + std::to_string(offset());
}

void Scanner::fail(const std::string& what) const {
  throw ReadFailure{"The mesh file cannot be read: " + what + " (" + place() + ")."};
}

void Scanner::fail_truncated(const char* what) const {
  throw ReadFailure{"The mesh file ends at byte " + std::to_string(end_ - begin_) +
                    (section.empty() ? "" : " inside $" + section) + ", where " + what +
                    " should follow: it is incomplete, so write or copy it again."};
}

void Scanner::fail_memory() const {
  fail(
      "up to here, the mesh takes more memory than 8 times the size of the file, which has very many very small parts; "
      "join its blocks of elements, its entities or its groups");
}

void Scanner::fail_token(const char* what) const {
  const char* stop = std::find_if(at_, end_, [](char c) { return static_cast<unsigned char>(c) <= ' '; });
  fail(std::string(what) + " was expected, found '" + shown({at_, std::size_t(stop - at_)}) + "'");
}

}  // namespace varimesh
