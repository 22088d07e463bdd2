// Buffered output of text and binary numbers to a sink, without an allocation per number.
#pragma once

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/error.h"
#include "core/base/io/sink.h"
#include "core/base/shared_work.h"
#include "core/base/team.h"

namespace varimesh {

/// Collects bytes and passes them to the sink in pieces. After the sink has refused a piece, it gets no more.
class BufferedOutput {
 public:
  explicit BufferedOutput(const Sink& sink, bool binary = false, const Team& team = Team(1))
      : binary(binary), sink_(sink), team_(team) {
    buffer_.resize(kPiece + kRoom);
  }

  const bool binary;
  const Team& team() const { return team_; }

  /// Writes the bytes unchanged.
  void text(std::string_view bytes) {
    if (bytes.size() > kRoom) return large(bytes);
    std::memcpy(room(), bytes.data(), bytes.size());
    used_ += bytes.size();
  }
  /// Writes an integer as text, also in binary files.
  void text_integer(std::int64_t value) {
    used_ = std::size_t(std::to_chars(room(), last(), value).ptr - buffer_.data());
  }
  /// Writes the shortest text that reads as the same double, 17 significant digits or fewer, also in binary files.
  void text_number(double value) { used_ = std::size_t(std::to_chars(room(), last(), value).ptr - buffer_.data()); }

  /// Write a C int, a C size_t and a double: in binary, or as text followed by a space.
  void integer(int value) { binary ? raw(std::int32_t(value)) : spaced(value); }
  void size(std::int64_t value) { binary ? raw(std::uint64_t(value)) : spaced(value); }
  void number(double value) {
    if (binary) return raw(value);
    text_number(value);
    text(" ");
  }
  /// Ends a line in ASCII files; does nothing in binary files.
  void end_line() {
    if (!binary) text("\n");
  }

  /// Writes `count` things. body(out, begin, end) writes those from begin to end − 1; the threads of the team call it
  /// for pieces of `per_piece` things, with outputs of their own, and the sink receives the pieces in order.
  /// `piece_bytes`: about how many bytes a piece has, if that is known.
  template <class Body>
  void shared(std::size_t count, std::size_t per_piece, const Body& body, std::size_t piece_bytes = 0) {
    if (team_.threads() == 1 || count <= per_piece) return body(*this, 0, count);
    flush();
    std::size_t next = 0;
    const auto cut = [&]() -> std::optional<std::size_t> {
      if (next >= count || stopped_) return std::nullopt;
      return std::exchange(next, next + per_piece);
    };
    const auto make = [&](std::size_t begin) {
      std::string bytes;
      bytes.reserve(piece_bytes);
      const Sink append = [&](std::string_view more) {
        bytes += more;
        return true;
      };
      BufferedOutput piece(append, binary);
      body(piece, begin, std::min(begin + per_piece, count));
      piece.flush();
      return bytes;
    };
    in_order(team_, cut, make, [&](const std::string& bytes) {
      if (!stopped_ && !sink_(bytes)) stopped_ = true;
      return !stopped_;
    });
  }

  /// Passes the remaining bytes to the sink. Errors: Output if the sink has refused a piece.
  Expected<void> finish() {
    flush();
    if (!stopped_) return {};
    return tl::unexpected<Error>(
        {Error::Kind::Output, "Writing stopped before the end of the mesh; the disk may be full."});
  }

 private:
  static constexpr std::size_t kPiece = std::size_t(1) << 18;
  static constexpr std::size_t kRoom = 64;  // more than any number needs

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
  const Team team_;
  std::vector<char> buffer_;
  std::size_t used_ = 0;
  std::atomic<bool> stopped_ = false;
};

}  // namespace varimesh
