#include "core/preconditioner/on_device/multigrid_on_device.h"

#include "core/base/index.h"
#include "core/preconditioner/multigrid/chebyshev.h"

namespace varimesh {
namespace {

/// The inverse of the matrix on the last level.
std::vector<double> inverse_of(const multigrid::DenseFactor& factor, std::size_t rows) {
  std::vector<double> inverse(rows * rows, 0.0);
  for (std::size_t i = 0; i < rows; ++i) inverse[i * rows + i] = 1;
  factor.solve(inverse.data(), static_cast<int>(rows));
  return inverse;
}

}  // namespace

MultigridOnDevice::MultigridOnDevice(device::Queue& queue, const device::Module* solver, int columns)
    : queue_(queue),
      columns_(columns),
      smooth_row_(queue.kernel(solver, "smooth_row")),
      residual_row_(queue.kernel(solver, "residual_row")),
      transfer_row_(queue.kernel(solver, "transfer_row")),
      dense_row_(queue.kernel(solver, "dense_row")) {}

template <class Matrix>
void MultigridOnDevice::copy_rows(const Matrix& from, Rows& to) {
  to.rows = from.rows;
  queue_.fill(to.begin, from.begin);
  queue_.fill(to.column, from.column);
  queue_.fill(to.value, from.value);
}

void MultigridOnDevice::copy(const Multigrid& multigrid) {
  levels_.resize(multigrid.levels().size());
  for (std::size_t number = 0; number < levels_.size(); ++number) {
    const Multigrid::Level& from = multigrid.levels()[number];
    Level& to = levels_[number];
    copy_rows(from.matrix, to.matrix);
    copy_rows(from.prolongator, to.prolongator);
    copy_rows(from.restrictor, to.restrictor);
    queue_.fill(to.diagonal, from.matrix.diagonal);
    queue_.fill(to.inverse, from.matrix.inverse);
    to.largest = from.largest;
    const std::size_t bytes = at(from.matrix.rows) * at(columns_) * sizeof(double);
    for (device::Buffer* vector : {&to.right, &to.solution, &to.scratch})
      if (vector->bytes() != bytes) *vector = queue_.room(bytes);
  }
  dense_ = {};
  if (multigrid.coarsest() != nullptr && !levels_.empty())
    queue_.fill(dense_, inverse_of(*multigrid.coarsest(), at(levels_.back().matrix.rows)));
}

void MultigridOnDevice::apply() { cycle(0); }

device::LevelArguments MultigridOnDevice::arguments_of(const Level& level, const device::Buffer& now,
                                                       const device::Buffer& next) {
  device::LevelArguments a;
  a.rows = level.matrix.rows;
  a.begin = level.matrix.begin.as<const std::int64_t>();
  a.column = level.matrix.column.as<const std::int32_t>();
  a.value = level.matrix.value.as<const float>();
  a.diagonal = level.diagonal.as<const double>();
  a.inverse = level.inverse.as<const double>();
  a.right = level.right.as<const double>();
  a.now = now.as<const double>();
  a.next = next.as<double>();
  return a;
}

void MultigridOnDevice::smooth(Level& level, bool from_zero) {
  const std::array<multigrid::ChebyshevStep, multigrid::kDegree> steps = multigrid::chebyshev_steps(level.largest);
  const device::Buffer *now = &level.solution, *next = &level.scratch;
  for (std::size_t k = 0; k < steps.size(); ++k) {
    device::LevelArguments a = arguments_of(level, *now, *next);
    a.momentum = steps[k].momentum;
    a.step = steps[k].step;
    a.is_zero = from_zero && k == 0 ? 1 : 0;
    a.was_zero = k == 0 || (from_zero && k == 1) ? 1 : 0;
    queue_.launch(smooth_row_, a.rows, a);
    std::swap(now, next);
  }
}

void MultigridOnDevice::transfer(const Rows& rows, const device::Buffer& from, const device::Buffer& to, bool adds) {
  device::RowsArguments a;
  a.rows = rows.rows;
  a.adds = adds ? 1 : 0;
  a.begin = rows.begin.as<const std::int64_t>();
  a.column = rows.column.as<const std::int32_t>();
  a.value = rows.value.as<const float>();
  a.from = from.as<const double>();
  a.to = to.as<double>();
  queue_.launch(transfer_row_, a.rows, a);
}

void MultigridOnDevice::cycle(std::size_t number) {
  Level& level = levels_[number];
  const bool is_last = number + 1 == levels_.size();
  if (is_last && dense_.bytes() > 0) {
    device::DenseArguments a{level.matrix.rows, dense_.as<const double>(), level.right.as<const double>(),
                             level.solution.as<double>()};
    queue_.launch(dense_row_, a.rows, a);
    return;
  }
  smooth(level, true);
  if (!is_last) {
    const device::LevelArguments a = arguments_of(level, level.solution, level.scratch);
    queue_.launch(residual_row_, a.rows, a);
    transfer(level.restrictor, level.scratch, levels_[number + 1].right, false);
    cycle(number + 1);
    transfer(level.prolongator, levels_[number + 1].solution, level.solution, true);
  }
  smooth(level, false);
}

std::size_t MultigridOnDevice::memory() const {
  const auto of_rows = [](const Rows& rows) { return rows.begin.bytes() + rows.column.bytes() + rows.value.bytes(); };
  std::size_t bytes = dense_.bytes();
  for (const Level& level : levels_)
    bytes += of_rows(level.matrix) + of_rows(level.prolongator) + of_rows(level.restrictor) + level.diagonal.bytes() +
             level.inverse.bytes() + level.right.bytes() + level.solution.bytes() + level.scratch.bytes();
  return bytes;
}

}  // namespace varimesh
