#include "core/preconditioner/multigrid/row_builder.h"

namespace varimesh::multigrid {

FloatRows joined(const Team& team, RowPieces&& pieces) {
  FloatRows out;
  out.rows = pieces.rows;
  out.columns = pieces.columns;
  out.begin.reserve(at(pieces.rows) + 1);
  out.begin.push_back(0);
  std::vector<std::int64_t> start;  // of each piece
  for (const RowPieces::Piece& piece : pieces.pieces) {
    start.push_back(out.begin.back());
    for (std::size_t i = 1; i < piece.begin.size(); ++i) out.begin.push_back(start.back() + piece.begin[i]);
  }
  out.column.resize(at(out.begin.back()));
  out.value.resize(at(out.begin.back()));
  team.for_ranges(pieces.pieces.size(), 4, [&](std::size_t first, std::size_t last) {
    for (std::size_t p = first; p < last; ++p) {
      const RowPieces::Piece piece = std::move(pieces.pieces[p]);
      std::copy(piece.column.begin(), piece.column.end(), out.column.begin() + start[p]);
      std::copy(piece.value.begin(), piece.value.end(), out.value.begin() + start[p]);
    }
  });
  return out;
}

FloatRows transposed(const FloatRows& matrix) {
  FloatRows out;
  out.rows = matrix.columns;
  out.columns = matrix.rows;
  out.begin.assign(at(out.rows) + 1, 0);
  for (const std::int32_t column : matrix.column) ++out.begin[at(column) + 1];
  for (std::int32_t i = 0; i < out.rows; ++i) out.begin[at(i) + 1] += out.begin[at(i)];
  out.column.resize(matrix.column.size());
  out.value.resize(matrix.value.size());
  std::vector<std::int64_t> next(out.begin.begin(), out.begin.end() - 1);
  for (std::int32_t row = 0; row < matrix.rows; ++row)
    for (std::int64_t e = matrix.begin[at(row)]; e < matrix.begin[at(row) + 1]; ++e) {
      const std::int64_t to = next[at(matrix.column[at(e)])]++;
      out.column[at(to)] = row;
      out.value[at(to)] = matrix.value[at(e)];
    }
  return out;
}

}  // namespace varimesh::multigrid
