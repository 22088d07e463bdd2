#include "core/preconditioner/multigrid/multigrid.h"

#include <algorithm>

#include "core/base/index.h"
#include "core/preconditioner/multigrid/chebyshev.h"
#include "core/preconditioner/multigrid/row_builder.h"
#include "core/preconditioner/multigrid/transfer.h"

namespace varimesh {
namespace {

using multigrid::kRowsPerTask;

/// θ of Strength. It has to separate entries that are 1/4 of the largest, as bilinear functions have along the long
/// side of a stretched mesh, from those that are 1/2 of it, as trilinear functions have at the corners of a cube.
constexpr double kThreshold = 0.4;
constexpr std::int32_t kMostDense = 256;  // rows
/// A level that is larger than this part of the one above it is not worth its cost.
constexpr double kLeastCoarsening = 0.9;

/// Calls body(value, from) for the entries of a row: from is where the d numbers of the entry's column are in x.
template <int d, class Body>
void for_row(const multigrid::FloatRows& rows, std::size_t row, const double* x, const Body& body) {
  for (std::int64_t e = rows.begin[row]; e < rows.begin[row + 1]; ++e)
    body(static_cast<double>(rows.value[at(e)]), x + at(rows.column[at(e)]) * d);
}

template <class T>
std::size_t size_of(const std::vector<T>& array) {
  return array.capacity() * sizeof(T);
}

}  // namespace

void Multigrid::set_up(const CompressedRows& matrix) { build(matrix, false); }

void Multigrid::update(const CompressedRows& matrix) { build(matrix, true); }

void Multigrid::build(const CompressedRows& matrix, bool keeps_aggregates) {
  std::vector<multigrid::Aggregates> kept;
  for (Level& level : levels_)
    if (keeps_aggregates) kept.push_back(std::move(level.aggregates));
  levels_.clear();
  multigrid::LevelMatrix next = multigrid::level_matrix(team_, matrix);
  while (true) {
    const std::size_t number = levels_.size();
    Level& level = levels_.emplace_back();
    level.matrix = std::move(next);
    const std::int32_t rows = level.matrix.rows;
    is_dense_ = rows <= kMostDense;
    if (is_dense_) {
      coarsest_ = multigrid::DenseFactor(level.matrix);
      return;
    }
    level.largest = multigrid::largest_eigenvalue(team_, level.matrix);
    const multigrid::Strength strength(team_, level.matrix, kThreshold);
    level.aggregates =
        number < kept.size() ? std::move(kept[number]) : multigrid::aggregate(team_, level.matrix, strength);
    if (level.aggregates.count == 0 || level.aggregates.count > kLeastCoarsening * rows) return;
    level.prolongator = multigrid::prolongator(team_, level.matrix, strength, level.aggregates);
    level.restrictor = multigrid::transposed(level.prolongator);
    next = multigrid::coarse_matrix(team_, level.matrix, level.prolongator, level.restrictor);
  }
}

template <int d>
void Multigrid::correct(std::size_t number, const double* right, double* solution) {
  Level &level = levels_[number], &coarse = levels_[number + 1];
  multigrid::residual<d>(team_, level.matrix, right, solution, level.scratch.data());
  team_.for_ranges(at(coarse.matrix.rows), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      double sum[d] = {};
      for_row<d>(level.restrictor, i, level.scratch.data(), [&](double value, const double* from) {
        for (int k = 0; k < d; ++k) sum[k] += value * from[k];
      });
      for (int k = 0; k < d; ++k) coarse.right[i * d + at(k)] = sum[k];
    }
  });
  cycle<d>(number + 1, coarse.right.data(), coarse.solution.data());
  team_.for_ranges(at(level.matrix.rows), kRowsPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i)
      for_row<d>(level.prolongator, i, coarse.solution.data(), [&](double value, const double* from) {
        for (int k = 0; k < d; ++k) solution[i * d + at(k)] += value * from[k];
      });
  });
}

template <int d>
void Multigrid::cycle(std::size_t number, const double* right, double* solution) {
  Level& level = levels_[number];
  const bool is_last = number + 1 == levels_.size();
  if (is_last && is_dense_) {
    std::copy(right, right + at(level.matrix.rows) * d, solution);
    coarsest_.solve(solution, d);
    return;
  }
  multigrid::smooth<d>(team_, level.matrix, level.largest, right, solution, level.scratch.data(), true);
  if (!is_last) correct<d>(number, right, solution);
  multigrid::smooth<d>(team_, level.matrix, level.largest, right, solution, level.scratch.data(), false);
}

void Multigrid::apply(std::span<const double> right, std::span<double> solution, int columns) {
  if (levels_.empty()) return;
  for (std::size_t number = 0; number < levels_.size(); ++number) {
    Level& level = levels_[number];
    const std::size_t size = at(level.matrix.rows) * at(columns);
    level.scratch.resize(size);
    if (number == 0) continue;
    level.right.resize(size);
    level.solution.resize(size);
  }
  if (columns == 1) cycle<1>(0, right.data(), solution.data());
  if (columns == 2) cycle<2>(0, right.data(), solution.data());
  if (columns == 3) cycle<3>(0, right.data(), solution.data());
}

std::vector<std::int32_t> Multigrid::level_rows() const {
  std::vector<std::int32_t> rows;
  for (const Level& level : levels_) rows.push_back(level.matrix.rows);
  return rows;
}

std::size_t Multigrid::bytes() const {
  const auto of_rows = [](const multigrid::FloatRows& rows) {
    return size_of(rows.begin) + size_of(rows.column) + size_of(rows.value);
  };
  std::size_t sum = coarsest_.bytes();
  for (const Level& level : levels_) {
    const multigrid::LevelMatrix& matrix = level.matrix;
    sum += size_of(matrix.begin) + size_of(matrix.column) + size_of(matrix.value) + size_of(matrix.diagonal) +
           size_of(matrix.inverse) + of_rows(level.prolongator) + of_rows(level.restrictor) +
           size_of(level.aggregates.of_row) + size_of(level.right) + size_of(level.solution) + size_of(level.scratch);
  }
  return sum;
}

std::int64_t Multigrid::bytes_needed(std::int64_t rows, std::int64_t entries, int columns) {
  constexpr double kAllLevels = 1.15;  // entries of all levels and transfers, over those of the first
  constexpr std::int64_t kPerEntry = sizeof(float) + sizeof(std::int32_t);
  constexpr std::int64_t kPerRow = 100;  // what a row has by itself: its place, diagonal, inverse, aggregate, transfers
  const std::int64_t vectors = 2 * columns * static_cast<std::int64_t>(sizeof(double));
  return static_cast<std::int64_t>(kAllLevels * static_cast<double>(kPerEntry * entries)) + (kPerRow + vectors) * rows;
}

}  // namespace varimesh
