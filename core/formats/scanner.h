// Reads numbers and lines from a file's bytes, text or binary, and says where it was when something was wrong.
#pragma once

#include <charconv>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>

namespace varimesh::formats {

/// Thrown inside the readers alone, and turned into an Error at their door (read()): a parser that returned each
/// failure would be mostly that.
struct ReadFailure {
  std::string sentence;
};

/// A cursor over a file's bytes. Numbers are read as text or as native binary by `binary`; nothing is copied.
class Scanner {
 public:
  explicit Scanner(std::string_view bytes) : begin_(bytes.data()), at_(begin_), end_(begin_ + bytes.size()) {}

  bool binary = false;
  std::string section;  ///< Name of the section being read, for the sentences.

  std::size_t offset() const { return std::size_t(at_ - begin_); }
  std::size_t left() const { return std::size_t(end_ - at_); }
  bool at_end() const { return at_ == end_; }
  char peek() const { return at_ < end_ ? *at_ : '\0'; }

  void skip_space() {
    while (at_ < end_ && static_cast<unsigned char>(*at_) <= ' ') ++at_;
  }

  /// What is left of this line, without its end; moves past it.
  std::string_view line();

  /// The bytes before the next line that is `text` alone; stays before that line. `found` is false where there is none.
  std::string_view until_line(std::string_view text, bool& found);

  /// An integer written in digits, whatever the file's mode.
  std::int64_t text_integer(const char* what);
  /// A number written as text, whatever the file's mode.
  double text_number(const char* what);

  /// A C int, a C size_t and a double: text or binary.
  int integer(const char* what);
  std::int64_t size(const char* what) { return binary ? raw_size(what) : text_integer(what); }
  double number(const char* what) { return binary ? raw<double>(what) : text_number(what); }

  /// A count of things that each take at least `least` bytes, so that a damaged count never asks for memory.
  std::int64_t count(const char* what, std::size_t least, bool as_text = false);

  /// Stops with a sentence that ends in the place.
  [[noreturn]] void fail(const std::string& what) const;
  [[noreturn]] void fail_truncated(const char* what) const;

 private:
  template <class T>
  T raw(const char* what) {
    if (left() < sizeof(T)) fail_truncated(what);
    T value;
    std::memcpy(&value, at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  std::int64_t raw_size(const char* what) {
    const auto value = raw<std::uint64_t>(what);
    if (value > std::uint64_t(std::numeric_limits<std::int64_t>::max())) fail(std::string(what) + " is out of range");
    return std::int64_t(value);
  }
  [[noreturn]] void fail_token(const char* what) const;
  std::string place() const;

  const char* begin_;
  const char* at_;
  const char* end_;
};

inline std::int64_t Scanner::text_integer(const char* what) {
  skip_space();
  if (at_ == end_) fail_truncated(what);
  const char* p = at_;
  const bool negative = *p == '-';
  if (*p == '-' || *p == '+') ++p;
  const char* digits = p;
  std::int64_t value = 0;
  while (p < end_ && static_cast<unsigned char>(*p - '0') <= 9) value = value * 10 + (*p++ - '0');
  // 18 digits always fit; nothing that counts in a mesh needs more.
  if (p == digits || p - digits > 18 || (p<end_&& static_cast<unsigned char>(*p)> ' ')) fail_token(what);
  at_ = p;
  return negative ? -value : value;
}

inline double Scanner::text_number(const char* what) {
  skip_space();
  if (at_ == end_) fail_truncated(what);
  const char* p = *at_ == '+' ? at_ + 1 : at_;
  double value = 0;
  const auto [stop, error] = std::from_chars(p, end_, value);
  if (stop == p || (stop<end_&& static_cast<unsigned char>(*stop)> ' ')) fail_token(what);
  // from_chars leaves the value alone when it is too large or too small for a double; strtod says which.
  if (error == std::errc::result_out_of_range) value = std::strtod(std::string(p, stop).c_str(), nullptr);
  at_ = stop;
  return value;
}

inline int Scanner::integer(const char* what) {
  if (binary) return raw<std::int32_t>(what);
  const std::int64_t value = text_integer(what);
  if (value < std::numeric_limits<int>::min() || value > std::numeric_limits<int>::max())
    fail(std::string(what) + " is out of range");
  return int(value);
}

}  // namespace varimesh::formats
