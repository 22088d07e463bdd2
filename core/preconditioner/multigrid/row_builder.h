// Builds sparse matrices row by row, with as many threads as there are and the same bits for any number of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/preconditioner/multigrid/sparse_rows.h"

namespace varimesh::multigrid {

/// Adds up the entries of one row after another, in double precision and in the order of the calls.
class RowSum {
 public:
  explicit RowSum(std::int32_t columns) : place_(at(columns), -1) {}

  void add(std::int32_t column, double value) {
    std::int32_t& place = place_[at(column)];
    if (place < 0) {
      place = static_cast<std::int32_t>(entries_.size());
      entries_.emplace_back(column, value);
    } else {
      entries_[at(place)].second += value;
    }
  }

  /// Appends the row, its columns ascending, and starts the next one.
  void finish(std::vector<std::int32_t>& columns, std::vector<float>& values) {
    std::sort(entries_.begin(), entries_.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (const auto& [column, value] : entries_) {
      columns.push_back(column);
      values.push_back(static_cast<float>(value));
      place_[at(column)] = -1;
    }
    entries_.clear();
  }

 private:
  std::vector<std::int32_t> place_;  ///< By column: where its entry is, or −1.
  std::vector<std::pair<std::int32_t, double>> entries_;
};

/// Rows in pieces of kRowsPerPiece, as they come from the threads.
struct RowPieces {
  static constexpr std::int32_t kRowsPerPiece = 1024;
  struct Piece {
    std::vector<std::int32_t> begin;  ///< Rows of the piece + 1.
    std::vector<std::int32_t> column;
    std::vector<float> value;
  };
  std::int32_t rows = 0;
  std::int32_t columns = 0;
  std::vector<Piece> pieces;
};

/// Calls add_row(i, sum) for each row i, from several threads at once; it adds the entries of row i to `sum`.
template <class AddRow>
RowPieces build_pieces(const Team& team, std::int32_t rows, std::int32_t columns, const AddRow& add_row) {
  constexpr std::int32_t kRows = RowPieces::kRowsPerPiece;
  RowPieces out{rows, columns, std::vector<RowPieces::Piece>(at((std::int64_t{rows} + kRows - 1) / kRows))};
  team.for_ranges(out.pieces.size(), 4, [&](std::size_t first, std::size_t last) {
    RowSum sum(columns);
    for (std::size_t p = first; p < last; ++p) {
      RowPieces::Piece piece;
      const std::int64_t begin = static_cast<std::int64_t>(p) * kRows,
                         end = std::min<std::int64_t>(rows, begin + kRows);
      piece.begin.push_back(0);
      for (std::int64_t i = begin; i < end; ++i) {
        add_row(static_cast<std::int32_t>(i), sum);
        sum.finish(piece.column, piece.value);
        piece.begin.push_back(static_cast<std::int32_t>(piece.column.size()));
      }
      piece.column.shrink_to_fit();
      piece.value.shrink_to_fit();
      out.pieces[p] = std::move(piece);
    }
  });
  return out;
}

/// The pieces as one matrix; they are left empty.
FloatRows joined(const Team& team, RowPieces&& pieces);

/// Rows and columns exchanged; the entries of a row are in the order of the old rows.
FloatRows transposed(const FloatRows& matrix);

}  // namespace varimesh::multigrid
