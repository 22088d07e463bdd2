// Buffered output to a sink: text and binary numbers, without a string a number.
#pragma once

#include <charconv>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/formats.h"

namespace varimesh::formats {

/// Collects bytes and hands them to the sink a piece at a time. Once the sink has refused, nothing more is handed over.
class Output {
 public:
  explicit Output(const Sink& sink, bool binary = false) : binary(binary), sink_(sink) {
    buffer_.resize(kPiece + kRoom);
  }

  const bool binary;

  /// As it is.
  void text(std::string_view bytes) {
    if (bytes.size() > kRoom) return large(bytes);
    std::memcpy(room(), bytes.data(), bytes.size());
    used_ += bytes.size();
  }
  /// In digits, whatever the mode.
  void text_integer(std::int64_t value) {
    used_ = std::size_t(std::to_chars(room(), last(), value).ptr - buffer_.data());
  }
  /// The shortest text that reads as the same double: 17 significant digits or fewer.
  void text_number(double value) { used_ = std::size_t(std::to_chars(room(), last(), value).ptr - buffer_.data()); }

  /// A C int, a C size_t, a double: binary, or text followed by a space.
  void integer(int value) { binary ? raw(std::int32_t(value)) : spaced(value); }
  void size(std::int64_t value) { binary ? raw(std::uint64_t(value)) : spaced(value); }
  void number(double value) {
    if (binary) return raw(value);
    text_number(value);
    text(" ");
  }
  /// Ends a line of text; nothing in binary.
  void end_line() {
    if (!binary) text("\n");
  }

  /// Hands over what is left; Error::Output where the sink had stopped.
  Expected<void> finish() {
    flush();
    if (!stopped_) return {};
    return tl::unexpected<Error>(
        {Error::Kind::Output, "Writing stopped before the end of the mesh: the disk may be full."});
  }

 private:
  static constexpr std::size_t kPiece = std::size_t(1) << 18;
  static constexpr std::size_t kRoom = 64;  // more than any number takes

  char* room() {
    if (used_ > kPiece) flush();
    return buffer_.data() + used_;
  }
  char* last() { return buffer_.data() + buffer_.size(); }
  void flush() {
    if (!stopped_ && used_ > 0 && !sink_({buffer_.data(), used_})) stopped_ = true;
    used_ = 0;
  }
  void large(std::string_view bytes) {
    flush();
    if (!stopped_ && !sink_(bytes)) stopped_ = true;
  }
  void spaced(std::int64_t value) {
    text_integer(value);
    text(" ");
  }
  template <class T>
  void raw(T value) {
    std::memcpy(room(), &value, sizeof(T));
    used_ += sizeof(T);
  }

  const Sink& sink_;
  std::vector<char> buffer_;
  std::size_t used_ = 0;
  bool stopped_ = false;
};

}  // namespace varimesh::formats
