// Reads long lists of records in pieces, which several threads parse at the same time. Internal to core/formats.
#pragma once

#include <cstring>
#include <optional>
#include <string_view>
#include <utility>

#include "core/base/io/scanner.h"
#include "core/base/shared_work.h"

namespace varimesh::formats {

/// Bytes of a piece. A thread parses a piece in about 5 ms as text and in well under one in binary; the pieces that are
/// in memory at the same time need a few MiB.
inline constexpr std::size_t kPieceBytes = std::size_t(1) << 19;

/// By how many records a piece may grow so that records that belong together stay together.
inline constexpr int kMostAlike = 64;

/// Reads pieces of a list as long as they can be read; the plain reader goes on from where this stops. So a faulty list
/// gives the error of the plain reader, whatever the number of threads, and a list that is laid out in an unusual way
/// is read too, only by one thread.
///
/// A piece is accepted only if its records end exactly where it ends. The first piece begins with a record; therefore
/// each piece that is accepted does.
///
/// @param scan  stands at the first record; afterwards behind the last piece that was accepted
/// @param next  returns the next piece, with a member `bytes`; nothing if the plain reader is to read the rest
/// @param parse parse(piece, scanner of its bytes) returns the records; throws ReadFailure if it cannot read them
/// @param take  take(piece, records) stores the records and returns true, or returns false to refuse the piece
template <class Next, class Parse, class Take>
void read_in_pieces(Scanner& scan, const Team& team, Next&& next, const Parse& parse, const Take& take) {
  using Piece = typename decltype(next())::value_type;
  using Records = decltype(parse(std::declval<const Piece&>(), std::declval<Scanner&>()));
  const auto make = [&](Piece& piece) {
    std::pair<Piece, std::optional<Records>> made{std::move(piece), std::nullopt};
    Scanner inside(made.first.bytes);
    Allowance allowance(kPieceMemory, team.stop());
    inside.binary = scan.binary;
    inside.allowance = &allowance;
    try {
      made.second = parse(made.first, inside);
      inside.skip_space_of_text();
      if (!inside.at_end()) made.second.reset();
    } catch (const ReadFailure&) {
      // The plain reader says what is wrong, or reads what is too large for a piece.
    }
    return made;
  };
  std::size_t end = scan.offset();
  in_order(team, next, make, [&](std::pair<Piece, std::optional<Records>> made) {
    if (!made.second || !take(made.first, *made.second)) return false;
    end += made.first.bytes.size();
    return true;
  });
  scan.go_to(end);
}

/// A piece that consists of bytes only.
struct BytesPiece {
  std::string_view bytes;
};

/// Cuts a list of records into pieces: as text after lines, if each record is on a line of its own; in binary after
/// records, if all have the same size.
class RecordCutter {
 public:
  /// @param scan   stands at the first record
  /// @param count  number of records
  /// @param record bytes of a record in binary
  RecordCutter(Scanner& scan, std::int64_t count, std::size_t record)
      : record_(scan.binary ? record : 0), left_(count) {
    scan.skip_space_of_text();
    rest_ = scan.rest();
  }

  std::optional<BytesPiece> operator()() {
    const std::string_view piece = record_ > 0 ? records() : lines();
    if (piece.empty()) return std::nullopt;
    rest_.remove_prefix(piece.size());
    return BytesPiece{piece};
  }

  /// Makes pieces of text end before a line that is unlike the line before it; lines are alike if more than half of
  /// them is the same at the end.
  bool keeps_alike_lines_together = false;

 private:
  std::string_view records() {
    const auto most = std::int64_t(std::max<std::size_t>(1, kPieceBytes / record_));
    const std::int64_t count = std::min({left_, most, std::int64_t(rest_.size() / record_)});
    left_ -= count;
    return rest_.substr(0, std::size_t(count) * record_);
  }

  std::string_view lines() {
    std::size_t size = 0, before = 0;
    for (int alike = 0; left_ > 0; --left_) {
      if (size >= kPieceBytes && !(keeps_alike_lines_together && alike++ < kMostAlike && is_alike(before, size))) break;
      const auto* stop = static_cast<const char*>(std::memchr(rest_.data() + size, '\n', rest_.size() - size));
      if (stop == nullptr) break;
      before = std::exchange(size, std::size_t(stop - rest_.data()) + 1);
    }
    return rest_.substr(0, size);
  }

  // Whether the line at `before`, which ends at `line`, and the line at `line` are alike.
  bool is_alike(std::size_t before, std::size_t line) const {
    const std::string_view last = rest_.substr(before, line - before), tail = rest_.substr(line);
    const std::string_view next = tail.substr(0, tail.find('\n') + 1);
    std::size_t same = 0;
    while (same < std::min(last.size(), next.size()) && last[last.size() - 1 - same] == next[next.size() - 1 - same])
      ++same;
    return 2 * same > std::max(last.size(), next.size());
  }

  std::size_t record_;
  std::int64_t left_;
  std::string_view rest_;
};

}  // namespace varimesh::formats
