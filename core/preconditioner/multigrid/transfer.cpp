#include "core/preconditioner/multigrid/transfer.h"

#include <algorithm>
#include <utility>

#include "core/preconditioner/multigrid/row_builder.h"

namespace varimesh::multigrid {
namespace {

constexpr double kDamping = 2.0 / 3;  // ω

std::vector<double> times(const Team& team, const FloatRows& matrix, const std::vector<double>& x) {
  std::vector<double> product(at(matrix.rows));
  team.for_ranges(product.size(), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i)
      for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e)
        product[i] += static_cast<double>(matrix.value[at(e)]) * x[at(matrix.column[at(e)])];
  });
  return product;
}

}  // namespace

FloatRows prolongator(const Team& team, const LevelMatrix& matrix, const Strength& strength,
                      const Aggregates& aggregates) {
  const auto add_row = [&](std::int32_t row, RowSum& sum) {
    const std::size_t i = at(row);
    const std::int32_t own = aggregates.of_row[i];
    const double damping = own < 0 ? 1 : kDamping;
    double strong = 0, all = matrix.diagonal[i];  // sums of −a_ij and of all a_ij
    for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e) {
      const float value = matrix.value[at(e)];
      all += static_cast<double>(value);
      if (strength.is_strong(i, at(matrix.column[at(e)]), value)) strong -= static_cast<double>(value);
    }
    const double diagonal = strong + std::max(all, 0.0);
    if (own >= 0) sum.add(own, diagonal > 0 ? 1 - damping : 1);
    if (diagonal <= 0) return;
    for (std::int64_t e = matrix.begin[i]; e < matrix.begin[i + 1]; ++e) {
      const std::size_t other = at(matrix.column[at(e)]);
      const float value = matrix.value[at(e)];
      if (strength.is_strong(i, other, value) && aggregates.of_row[other] >= 0)
        sum.add(aggregates.of_row[other], -damping * static_cast<double>(value) / diagonal);
    }
  };
  return joined(team, build_pieces(team, matrix.rows, aggregates.count, add_row));
}

LevelMatrix coarse_matrix(const Team& team, const LevelMatrix& matrix, const FloatRows& prolongator,
                          const FloatRows& restrictor) {
  const auto for_row = [](const FloatRows& rows, std::int32_t row, const auto& body) {
    for (std::int64_t e = rows.begin[at(row)]; e < rows.begin[at(row) + 1]; ++e)
      body(rows.column[at(e)], static_cast<double>(rows.value[at(e)]));
  };
  const RowPieces product = build_pieces(team, matrix.rows, prolongator.columns, [&](std::int32_t row, RowSum& sum) {
    const auto add = [&](std::int32_t from, double factor) {
      for_row(prolongator, from, [&](std::int32_t column, double value) { sum.add(column, factor * value); });
    };
    add(row, matrix.diagonal[at(row)]);
    for (std::int64_t e = matrix.begin[at(row)]; e < matrix.begin[at(row) + 1]; ++e)
      add(matrix.column[at(e)], static_cast<double>(matrix.value[at(e)]));
  });
  RowPieces off_diagonal = build_pieces(team, restrictor.rows, prolongator.columns, [&](std::int32_t row, RowSum& sum) {
    for_row(restrictor, row, [&](std::int32_t from, double factor) {
      const RowPieces::Piece& piece = product.pieces[at(from / RowPieces::kRowsPerPiece)];
      const std::size_t in_piece = at(from % RowPieces::kRowsPerPiece);
      for (std::size_t e = at(piece.begin[in_piece]); e < at(piece.begin[in_piece + 1]); ++e)
        if (piece.column[e] != row) sum.add(piece.column[e], factor * static_cast<double>(piece.value[e]));
    });
  });
  std::vector<double> sums;
  multiply(team, matrix, times(team, prolongator, std::vector<double>(at(prolongator.columns), 1.0)), sums);
  return level_matrix(team, joined(team, std::move(off_diagonal)), times(team, restrictor, sums));
}

}  // namespace varimesh::multigrid
