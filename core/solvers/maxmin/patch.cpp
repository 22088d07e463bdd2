#include "core/solvers/maxmin/patch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/index.h"
#include "core/solvers/maxmin/simplex_program.h"

namespace varimesh {
namespace {

constexpr int kPower = 8;  // of the norm M; look() and fill_rows() write it out
/// Samples whose level is at most this much above the smallest take part in a step, but no more than kMostRows.
constexpr double kBand = 0.15;
constexpr std::size_t kMostRows = 600;
constexpr double kFirstDamping = 10;  // ρ
constexpr double kLessOrMore = 3;
/// Shares of the predicted gain: a step with less is not taken, one with more lets ρ fall.
constexpr double kLeastShare = 0.2, kGoodShare = 0.7;
constexpr int kMostSteps = 40;
constexpr int kMostTrials = 12;
/// The end: so many steps, one after another, have each raised the smallest level by less than this.
constexpr double kLittle = 3e-4;
constexpr int kMostLittle = 5;
/// After that many steps, a patch whose smallest level would stay negative at the pace of the last ones ends too.
constexpr int kStepsOfPace = 8;

}  // namespace

MaxMinPatch::MaxMinPatch(std::vector<Cell> cells, std::vector<std::int32_t> free_nodes, int dimension,
                         const std::vector<double>& coordinates)
    : cells_(std::move(cells)),
      free_(std::move(free_nodes)),
      size_(free_.size(), std::numeric_limits<double>::max()),
      dimension_(dimension) {
  for (Cell& cell : cells_) {
    for (std::size_t n = 0; n < cell.nodes.size(); ++n) {
      const auto found = std::ranges::lower_bound(free_, cell.nodes[n]);
      if (found == free_.end() || *found != cell.nodes[n]) continue;
      cell.local.push_back(static_cast<int>(n));
      cell.place.push_back(static_cast<int>(found - free_.begin()));
    }
    double shortest = std::numeric_limits<double>::max();
    for (const auto& edge : reference::info(cell.shape).edges) {
      const double* a = coordinates.data() + 3 * at(cell.nodes[at(edge[0])]);
      const double* b = coordinates.data() + 3 * at(cell.nodes[at(edge[1])]);
      shortest = std::min(shortest, std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]));
    }
    for (const int place : cell.place) size_[at(place)] = std::min(size_[at(place)], shortest);
  }
  std::erase_if(cells_, [](const Cell& cell) { return cell.local.empty(); });
}

// ===== the cells at some coordinates =====

void MaxMinPatch::differentiate(const Cell& cell, const std::vector<double>& coordinates, ByPoint& derivatives) const {
  thread_local std::vector<double> x;
  const std::size_t d = at(dimension_);
  x.resize(d * cell.nodes.size());
  for (std::size_t n = 0; n < cell.nodes.size(); ++n) std::copy_n(&coordinates[3 * at(cell.nodes[n])], d, &x[d * n]);
  derivatives.resize(d * d * cell.samples->padded_points());
  cell.samples->differentiate(x.data(), derivatives.data());
}

void MaxMinPatch::find_cofactors(const ByPoint& f, ByPoint& cofactors) const {
  const std::size_t d = at(dimension_), points = f.size() / (d * d);
  cofactors.resize(f.size());
  const auto of = [&](std::size_t k, std::size_t c) { return f.data() + (k * d + c) * points; };
  const auto to = [&](std::size_t k, std::size_t c) { return cofactors.data() + (k * d + c) * points; };
  for (std::size_t k = 0; k < d; ++k)
    for (std::size_t c = 0; c < d; ++c) {
      double* const out = to(k, c);
      if (d == 2) {
        const double *const other = of(1 - k, 1 - c), sign = k == c ? 1 : -1;
        for (std::size_t i = 0; i < points; ++i) out[i] = sign * other[i];
        continue;
      }
      const std::size_t a = (k + 1) % 3, b = (k + 2) % 3, p = (c + 1) % 3, q = (c + 2) % 3;
      const double *const ap = of(a, p), *const aq = of(a, q), *const bp = of(b, p), *const bq = of(b, q);
      for (std::size_t i = 0; i < points; ++i) out[i] = ap[i] * bq[i] - aq[i] * bp[i];
    }
}

MaxMinPatch::Seen MaxMinPatch::look(const Cell& cell, const std::vector<double>& coordinates) const {
  thread_local ByPoint f, cofactors;
  differentiate(cell, coordinates, f);
  find_cofactors(f, cofactors);
  const std::size_t points = cell.samples->padded_points();
  Seen seen;
  seen.jacobian.resize(static_cast<Eigen::Index>(cell.samples->points()));
  for (std::size_t i = 0; i < cell.samples->points(); ++i) {
    double sum = 0;
    for (std::size_t c = 0; c < at(dimension_); ++c) sum += f[c * points + i] * cofactors[c * points + i];
    seen.jacobian(static_cast<Eigen::Index>(i)) = sum;
  }
  const double largest = seen.jacobian.cwiseAbs().maxCoeff();
  const double smallest = seen.jacobian.minCoeff(), highest = seen.jacobian.maxCoeff();
  if (!(largest > 0) || !std::isfinite(largest)) {
    seen.level = seen.scaled_jacobian = -1;
    return seen;
  }
  seen.norm = largest * std::pow((seen.jacobian / largest).array().square().square().square().mean(), 1.0 / kPower);
  seen.level = smallest / seen.norm;
  seen.scaled_jacobian = highest > 0 ? std::max(-1.0, smallest / highest) : -1;
  return seen;
}

double MaxMinPatch::look_at_all(const std::vector<double>& coordinates, std::vector<Seen>& seen,
                                const Team& team) const {
  seen.resize(cells_.size());
  team.for_each(static_cast<std::int32_t>(cells_.size()), 1,
                [&](std::int32_t c) { seen[at(c)] = look(cells_[at(c)], coordinates); });
  double smallest = std::numeric_limits<double>::max();
  for (std::size_t c = 0; c < seen.size(); ++c) smallest = std::min(smallest, seen[c].level + cells_[c].shift);
  return smallest;
}

MaxMinPatch::Levels MaxMinPatch::levels(const std::vector<Seen>& seen, double smallest) {
  Levels result;
  result.smallest = smallest;
  for (const Seen& each : seen) {
    result.level.push_back(each.level);
    result.scaled_jacobian.push_back(each.scaled_jacobian);
  }
  return result;
}

MaxMinPatch::Levels MaxMinPatch::look_at_cells(const std::vector<double>& coordinates, const Team& team) const {
  std::vector<Seen> seen;
  const double smallest = look_at_all(coordinates, seen, team);
  return levels(seen, smallest);
}

bool MaxMinPatch::is_reached(const std::vector<Seen>& seen, double aim) const {
  for (std::size_t c = 0; c < seen.size(); ++c)
    if (cells_[c].shift == 0 && seen[c].scaled_jacobian < aim) return false;
  return true;
}

// ===== a step =====

void MaxMinPatch::fill_rows(const Cell& cell, const Seen& seen, const std::vector<Eigen::Index>& samples,
                            const std::vector<double>& coordinates, Slopes& slopes, Rows& rows) const {
  thread_local ByPoint f, cofactors, weighted;
  differentiate(cell, coordinates, f);
  find_cofactors(f, cofactors);
  const SampleTable& table = *cell.samples;
  const std::size_t d = at(dimension_), points = table.padded_points();
  // dM = Σ_i weight_i dJ_i
  weighted.assign(cofactors.size(), 0.0);
  for (std::size_t i = 0; i < table.points(); ++i) {
    const double relative = seen.jacobian(static_cast<Eigen::Index>(i)) / seen.norm;
    const double square = relative * relative;
    const double weight = square * square * square * relative / static_cast<double>(table.points());
    for (std::size_t each = 0; each < d * d; ++each)
      weighted[each * points + i] = weight * cofactors[each * points + i];
  }
  thread_local std::vector<double> of_norm;
  of_norm.resize(d * table.nodes());
  table.add_up(weighted.data(), of_norm.data());
  slopes.rows.resize(static_cast<Eigen::Index>(samples.size()),
                     dimension_ * static_cast<Eigen::Index>(cell.local.size()));
  for (std::size_t s = 0; s < samples.size(); ++s) {
    const Eigen::Index i = samples[s], row = static_cast<Eigen::Index>(s);
    const double level = seen.jacobian(i) / seen.norm;
    rows.level(slopes.first + row) = level + cell.shift;
    for (std::size_t n = 0; n < cell.local.size(); ++n)
      for (std::size_t c = 0; c < d; ++c) {
        const std::size_t node = at(cell.local[n]);
        double slope = -level * of_norm[node * d + c];
        for (std::size_t k = 0; k < d; ++k)
          slope += table.gradient(at(i), node, k) * cofactors[(k * d + c) * points + at(i)];
        slopes.rows(row, static_cast<Eigen::Index>(n * d + c)) = slope / seen.norm * size_[at(cell.place[n])];
      }
  }
}

MaxMinPatch::Rows MaxMinPatch::rows(const std::vector<double>& coordinates, const std::vector<Seen>& seen,
                                    double smallest, const Team& team) const {
  struct Low {
    double level;
    std::size_t cell;
    Eigen::Index sample;
  };
  std::vector<Low> low;
  for (std::size_t c = 0; c < seen.size(); ++c)
    for (Eigen::Index i = 0; i < seen[c].jacobian.size(); ++i) {
      const double level = seen[c].jacobian(i) / seen[c].norm + cells_[c].shift;
      if (level < smallest + kBand) low.push_back({level, c, i});
    }
  if (low.size() > kMostRows) {
    std::ranges::stable_sort(low, {}, &Low::level);
    low.resize(kMostRows);
  }
  std::vector<std::vector<Eigen::Index>> samples(cells_.size());
  for (const Low& each : low) samples[each.cell].push_back(each.sample);
  Rows result;
  result.level.resize(static_cast<Eigen::Index>(low.size()));
  result.slopes.resize(cells_.size());
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    result.slopes[c].first = static_cast<Eigen::Index>(result.cell.size());
    result.cell.resize(result.cell.size() + samples[c].size(), static_cast<std::int32_t>(c));
  }
  team.for_each(static_cast<std::int32_t>(cells_.size()), 1, [&](std::int32_t c) {
    if (!samples[at(c)].empty())
      fill_rows(cells_[at(c)], seen[at(c)], samples[at(c)], coordinates, result.slopes[at(c)], result);
  });
  return result;
}

Eigen::VectorXd MaxMinPatch::times(const Rows& rows, const Eigen::VectorXd& z) const {
  Eigen::VectorXd result(rows.level.size());
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    const Slopes& slopes = rows.slopes[c];
    if (slopes.rows.rows() == 0) continue;
    Eigen::VectorXd own(slopes.rows.cols());
    for (std::size_t n = 0; n < cells_[c].place.size(); ++n)
      own.segment(static_cast<Eigen::Index>(n) * dimension_, dimension_) =
          z.segment(cells_[c].place[n] * dimension_, dimension_);
    result.segment(slopes.first, slopes.rows.rows()).noalias() = slopes.rows * own;
  }
  return result;
}

Eigen::VectorXd MaxMinPatch::transposed_times(const Rows& rows, const Eigen::VectorXd& weights) const {
  Eigen::VectorXd result = Eigen::VectorXd::Zero(dimension_ * static_cast<Eigen::Index>(free_.size()));
  for (std::size_t c = 0; c < cells_.size(); ++c) {
    const Slopes& slopes = rows.slopes[c];
    if (slopes.rows.rows() == 0) continue;
    const Eigen::VectorXd own = slopes.rows.transpose() * weights.segment(slopes.first, slopes.rows.rows());
    for (std::size_t n = 0; n < cells_[c].place.size(); ++n)
      result.segment(cells_[c].place[n] * dimension_, dimension_) +=
          own.segment(static_cast<Eigen::Index>(n) * dimension_, dimension_);
  }
  return result;
}

Eigen::VectorXd MaxMinPatch::column(const Rows& rows, Eigen::Index row) const {
  const std::size_t c = at(rows.cell[at(row)]);
  const Slopes& slopes = rows.slopes[c];
  Eigen::VectorXd z = Eigen::VectorXd::Zero(dimension_ * static_cast<Eigen::Index>(free_.size()));
  for (std::size_t n = 0; n < cells_[c].place.size(); ++n)
    z.segment(cells_[c].place[n] * dimension_, dimension_) =
        slopes.rows.row(row - slopes.first).segment(static_cast<Eigen::Index>(n) * dimension_, dimension_);
  return times(rows, z);
}

void MaxMinPatch::move(const Eigen::VectorXd& z, const std::vector<double>& from, std::vector<double>& to) const {
  for (std::size_t n = 0; n < free_.size(); ++n)
    for (int c = 0; c < dimension_; ++c) {
      const std::size_t entry = 3 * at(free_[n]) + at(c);
      to[entry] = from[3 * n + at(c)] + z(static_cast<Eigen::Index>(dimension_ * n) + c) * size_[n];
    }
}

MaxMinPatch::Levels MaxMinPatch::raise(std::vector<double>& coordinates, double aim, const Team& team) {
  std::vector<Seen> seen, seen_there;
  double smallest = look_at_all(coordinates, seen, team);
  auto looks = static_cast<std::int64_t>(cells_.size());
  double damping = kFirstDamping;
  std::vector<double> here(3 * free_.size()), path;
  for (int step = 0, little = 0; step < kMostSteps && little < kMostLittle && !is_reached(seen, aim); ++step) {
    team.look();
    const Rows low = rows(coordinates, seen, smallest, team);
    if (low.level.size() == 0) break;  // a cell that has collapsed is the lowest, and has no slopes
    for (std::size_t n = 0; n < free_.size(); ++n)
      std::copy_n(coordinates.data() + 3 * at(free_[n]), 3, here.data() + 3 * n);
    // The program needs few columns of A Aᵀ, the same ones in each trial.
    std::vector<Eigen::VectorXd> columns(at(low.level.size()));
    const auto column_of = [&](Eigen::Index row) -> const Eigen::VectorXd& {
      Eigen::VectorXd& made = columns[at(row)];
      if (made.size() == 0) made = column(low, row);
      return made;
    };
    double share = 0, there = smallest;
    for (int trial = 0; trial < kMostTrials && share < kLeastShare; ++trial) {
      if (trial > 0) damping *= kLessOrMore;
      const Eigen::VectorXd weights = detail::simplex_weights(column_of, 1 / damping, low.level);
      const Eigen::VectorXd z = transposed_times(low, weights) / damping;
      const double predicted = (low.level + times(low, z)).minCoeff() - smallest;
      move(z, here, coordinates);
      there = look_at_all(coordinates, seen_there, team.without_stop());
      looks += static_cast<std::int64_t>(cells_.size());
      share = predicted > 0 ? (there - smallest) / predicted : 0;
    }
    if (share < kLeastShare) {
      move(Eigen::VectorXd::Zero(dimension_ * static_cast<Eigen::Index>(free_.size())), here, coordinates);
      break;
    }
    if (share > kGoodShare) damping /= kLessOrMore;
    little = there - smallest < kLittle ? little + 1 : 0;
    smallest = there;
    seen.swap(seen_there);
    path.push_back(smallest);
    if (step < kStepsOfPace) continue;
    const double pace = (smallest - path[at(step - kStepsOfPace)]) / kStepsOfPace;
    if (smallest + (kMostSteps - step) * pace < 0) break;
  }
  Levels result = levels(seen, smallest);
  result.looks = looks;
  return result;
}

}  // namespace varimesh
