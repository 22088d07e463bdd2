#include "core/solvers/descent/quasi_newton.h"

#include <algorithm>

namespace varimesh {
namespace {

constexpr std::size_t kNumbersPerTask = 4096;

}  // namespace

double QuasiNewton::dot(std::span<const double> a, std::span<const double> b) {
  return reduction_.sum(a.size(), kNumbersPerTask, [&](std::size_t i) { return a[i] * b[i]; });
}

void QuasiNewton::add(double factor, std::span<const double> from, std::span<double> to) {
  team_.for_ranges(to.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) to[i] += factor * from[i];
  });
}

bool QuasiNewton::add_pair(std::span<const double> step, std::span<const double> change) {
  const double curvature = dot(step, change);
  if (!(curvature > 0)) return false;
  if (pairs_.empty()) {  // all at once, so that the memory of a run does not depend on how many steps it takes
    pairs_.resize(kPairs);
    for (Pair& one : pairs_) {
      one.step.resize(unknowns_);
      one.change.resize(unknowns_);
    }
  }
  newest_ = (newest_ + 1) % kPairs;
  used_ = std::min(used_ + 1, kPairs);
  Pair& added = pair(0);
  added.step.assign(step.begin(), step.end());
  added.change.assign(change.begin(), change.end());
  added.curvature = curvature;
  return true;
}

void QuasiNewton::begin(std::span<const double> g, std::span<double> q) {
  std::copy(g.begin(), g.end(), q.begin());
  for (std::size_t age = 0; age < used_; ++age) {
    Pair& one = pair(age);
    one.alpha = dot(one.step, q) / one.curvature;
    add(-one.alpha, one.change, q);
  }
}

double QuasiNewton::end(std::span<const double> g, std::span<double> step) {
  for (double& number : step) number *= scale_;
  for (std::size_t age = used_; age-- > 0;) {
    const Pair& one = pair(age);
    add(one.alpha - dot(one.change, step) / one.curvature, one.step, step);
  }
  team_.for_ranges(step.size(), kNumbersPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) step[i] = -step[i];
  });
  return dot(g, step);
}

}  // namespace varimesh
