#include "core/newton/linear_solver.h"

#include "core/base/index.h"

namespace varimesh {
namespace {

constexpr std::size_t kVerticesPerTask = 1024;

}  // namespace

void LinearSolver::analyse(const Matrix& lower) {
  is_factored_ = lower.rows() <= most_factored_;
  if (is_factored_) factor_.analyzePattern(lower);
}

bool LinearSolver::factorise(const Matrix& lower) {
  if (is_factored_) {
    factor_.factorize(lower);
    return factor_.info() == Eigen::Success;
  }
  set_up_multigrid(lower);
  return true;
}

void LinearSolver::set_up_multigrid(const Matrix& lower) {
  // Column v of the lower triangle is what row v has from its diagonal on. The rest of the row is in the columns
  // before.
  const std::size_t vertices = at(lower.rows());
  std::vector<std::int64_t> begin(vertices + 1);
  for (Eigen::Index v = 0; v < lower.cols(); ++v)
    for (Matrix::InnerIterator entry(lower, v); entry; ++entry) {
      ++begin[at(v) + 1];
      if (entry.row() != v) ++begin[at(entry.row()) + 1];
    }
  for (std::size_t v = 0; v < vertices; ++v) begin[v + 1] += begin[v];
  std::vector<std::int32_t> column(at(begin[vertices]));
  std::vector<double> value(at(begin[vertices]));
  std::vector<std::int64_t> next(begin.begin(), begin.end() - 1);
  const auto add = [&](Eigen::Index row, Eigen::Index of, double entry) {
    const std::size_t to = at(next[at(row)]++);
    column[to] = static_cast<std::int32_t>(of);
    value[to] = entry;
  };
  for (Eigen::Index v = 0; v < lower.cols(); ++v)
    for (Matrix::InnerIterator entry(lower, v); entry; ++entry) {
      add(v, entry.row(), entry.value());
      if (entry.row() != v) add(entry.row(), v, entry.value());
    }
  multigrid_.set_up({static_cast<std::int32_t>(vertices), begin.data(), column.data(), value.data()});
}

void LinearSolver::solve(const Eigen::MatrixXd& right, Eigen::MatrixXd& solution) {
  solution.resize(right.rows(), right.cols());
  if (is_factored_)
    team_.for_each(static_cast<std::int32_t>(right.cols()), 1,
                   [&](std::int32_t k) { solution.col(k) = factor_.solve(right.col(k)); });
  else
    apply_multigrid(right, solution);
}

void LinearSolver::apply_multigrid(const Eigen::MatrixXd& right, Eigen::MatrixXd& solution) {
  const Eigen::Index d = right.cols();
  right_.resize(at(right.size()));
  solution_.resize(at(right.size()));
  team_.for_ranges(at(right.rows()), kVerticesPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t v = first; v < last; ++v)
      for (Eigen::Index k = 0; k < d; ++k) right_[v * at(d) + at(k)] = right(static_cast<Eigen::Index>(v), k);
  });
  multigrid_.apply(right_, solution_, static_cast<int>(d));
  team_.for_ranges(at(right.rows()), kVerticesPerTask, [&](std::size_t first, std::size_t last) {
    for (std::size_t v = first; v < last; ++v)
      for (Eigen::Index k = 0; k < d; ++k) solution(static_cast<Eigen::Index>(v), k) = solution_[v * at(d) + at(k)];
  });
}

}  // namespace varimesh
