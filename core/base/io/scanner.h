// Reads numbers and lines from the bytes of a file, text or binary, and reports the position of errors.
#pragma once

#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/io/allowance.h"

namespace varimesh {

/// Thrown only inside the readers; read() converts it to an Error. A parser that returned every failure would consist
/// mostly of error handling.
struct ReadFailure {
  std::string sentence;
};

/// What is wrong with a node, after its name.
inline constexpr const char* kNotFinite =
    " has a coordinate that is not a finite number; let the program that made the mesh write it again";

/// A cursor over the bytes of a file. Reads numbers as text, or in native binary if `binary` is set. Copies nothing.
class Scanner {
 public:
  explicit Scanner(std::string_view bytes) : begin_(bytes.data()), at_(begin_), end_(begin_ + bytes.size()) {}

  bool binary = false;
  std::string section;             ///< Name of the section that is being read, for error messages.
  Allowance* allowance = nullptr;  ///< What counts the memory of the mesh; null: nothing does.

  std::size_t offset() const { return std::size_t(at_ - begin_); }
  std::size_t left() const { return std::size_t(end_ - at_); }
  bool at_end() const { return at_ == end_; }
  std::string_view rest() const { return {at_, left()}; }
  /// Moves the cursor to a byte of the file.
  void go_to(std::size_t offset) { at_ = begin_ + offset; }
  char peek() const { return at_ < end_ ? *at_ : '\0'; }

  void skip_space() {
    while (at_ < end_ && static_cast<unsigned char>(*at_) <= ' ') ++at_;
  }

  /// The same between numbers; in binary there is no space.
  void skip_space_of_text() {
    if (!binary) skip_space();
  }

  /// The rest of this line without its end. The cursor moves to the next line.
  std::string_view line();

  /// The bytes before the next line that consists of `text`. The cursor moves to this line. If there is none, `found`
  /// is false and the cursor does not move.
  std::string_view until_line(std::string_view text, bool& found);

  // The functions below take what they read as words for error messages, for example "a node's number".

  /// An integer as text, also in binary files.
  std::int64_t text_integer(const char* what);
  /// A number as text, also in binary files.
  double text_number(const char* what);

  /// A C int, a C size_t and a double: as text or binary.
  int integer(const char* what);
  std::int64_t size(const char* what) { return binary ? raw_size(what) : text_integer(what); }
  double number(const char* what) { return binary ? raw<double>(what) : text_number(what); }

  /// A coordinate that was read. Fails if it is not finite; name() says whose it is, such as "node 5".
  template <class Name>
  double finite(double coordinate, const Name& name) const {
    if (!std::isfinite(coordinate)) fail(name() + kNotFinite);
    return coordinate;
  }

  /// A count of things that each need at least `least` bytes of the file. Fails if the file is too short for them, so a
  /// damaged count never causes a large allocation. `as_text`: as text, also in binary files.
  std::int64_t count(const char* what, std::size_t least, bool as_text = false);

  // The functions below count memory before it is taken, and fail if the file asks for too much.

  void take_memory(std::size_t bytes) const {
    if (allowance != nullptr && !allowance->take(bytes)) fail_memory();
  }
  /// Makes room in a vector, for one element or for exactly as many as are given.
  template <class T>
  void make_room(std::vector<T>& values, std::size_t more = 1) const {
    if (allowance != nullptr && !allowance->make_room(values, more)) fail_memory();
  }
  template <class T>
  void reserve(std::vector<T>& values, std::size_t size) const {
    if (allowance == nullptr)
      reserve_large(values, size);
    else if (!allowance->reserve(values, size))
      fail_memory();
  }
  /// Adds an element.
  template <class T>
  void add(std::vector<T>& values, T value) const {
    make_room(values);
    values.push_back(std::move(value));
  }

  /// Called for every record. Throws Interrupted if reading is to stop.
  void look() const {
    if (allowance != nullptr) allowance->look();
  }

  /// Throw a ReadFailure. Its sentence contains the position in the file.
  [[noreturn]] void fail(const std::string& what) const;
  [[noreturn]] void fail_truncated(const char* what) const;
  [[noreturn]] void fail_memory() const;

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
    // As in text, so that a file can be written in both forms.
    if (value >= kNumberOf19Digits) fail(std::string(what) + " is out of range");
    return std::int64_t(value);
  }
  [[noreturn]] void fail_token(const char* what) const;
  std::string place() const;

  static constexpr std::uint64_t kNumberOf19Digits = 1'000'000'000'000'000'000;

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
  std::uint64_t magnitude = 0;  // of more digits than a number may have, the rest of a division by 2⁶⁴
  while (p < end_ && static_cast<unsigned char>(*p - '0') <= 9) magnitude = magnitude * 10 + std::uint64_t(*p++ - '0');
  // 18 digits always fit, and no number in a mesh file needs more.
  if (p == digits || p - digits > 18 || (p<end_&& static_cast<unsigned char>(*p)> ' ')) fail_token(what);
  at_ = p;
  const auto value = std::int64_t(magnitude);
  return negative ? -value : value;
}

inline double Scanner::text_number(const char* what) {
  skip_space();
  if (at_ == end_) fail_truncated(what);
  const char* p = *at_ == '+' ? at_ + 1 : at_;
  double value = 0;
  const auto [stop, error] = std::from_chars(p, end_, value);
  if (stop == p || (stop<end_&& static_cast<unsigned char>(*stop)> ' ')) fail_token(what);
  // from_chars does not set the value if it is too large or too small for a double; strtod does.
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

}  // namespace varimesh
