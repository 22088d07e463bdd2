#include "core/solvers/ritz_values.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace varimesh {
namespace {

constexpr double kAccuracy = 1e-3;
constexpr std::size_t kSolvesKept = 4;  // that many steps ago the mesh was another one
constexpr double kLongEnough = 2;

bool is_long_enough(const RitzValues& solve) {
  return solve.count() >= kLongEnough * std::sqrt(solve.largest() / solve.smallest());
}

}  // namespace

void RitzValues::clear() {
  diagonal_.clear();
  square_.clear();
  carry_ = last_alpha_ = 0;
}

void RitzValues::advance(double alpha) {
  diagonal_.push_back(1 / alpha + carry_);
  last_alpha_ = alpha;
}

void RitzValues::turn(double beta) {
  square_.push_back(beta / (last_alpha_ * last_alpha_));
  carry_ = beta / last_alpha_;
}

int RitzValues::below(double x) const {
  int count = 0;
  double pivot = 1;
  for (std::size_t j = 0; j < diagonal_.size(); ++j) {
    pivot = diagonal_[j] - x - (j > 0 ? square_[j - 1] / pivot : 0);
    if (pivot == 0) pivot = std::numeric_limits<double>::min();
    if (pivot < 0) ++count;
  }
  return count;
}

double RitzValues::bound() const {
  double bound = 0;
  for (std::size_t j = 0; j < diagonal_.size(); ++j)
    bound = std::max(bound, diagonal_[j] + (j > 0 ? std::sqrt(square_[j - 1]) : 0) +
                                (j + 1 < diagonal_.size() ? std::sqrt(square_[j]) : 0));
  return bound;
}

double RitzValues::smallest() const {
  if (diagonal_.empty()) return 0;
  // The smallest eigenvalue is at most the smallest entry of the diagonal. All are positive, so it is bisected by
  // quotients.
  double high = *std::min_element(diagonal_.begin(), diagonal_.end()) * (1 + kAccuracy), low = high;
  while (below(low) > 0 && low > std::numeric_limits<double>::min()) low *= 0.25;
  while (high > (1 + kAccuracy) * low) {
    const double middle = std::sqrt(low * high);
    (below(middle) > 0 ? high : low) = middle;
  }
  return low;
}

double RitzValues::largest() const {
  if (diagonal_.empty()) return 0;
  double low = *std::max_element(diagonal_.begin(), diagonal_.end()), high = std::max(low, bound());
  while (high > (1 + kAccuracy) * low) {
    const double middle = 0.5 * (low + high);
    (below(middle) == count() ? high : low) = middle;
  }
  return high;
}

double Spectrum::reduction(int products) const {
  const double root = std::sqrt(largest / smallest);
  return 2 * root * std::exp(-2 * products / root);
}

void SpectrumEstimate::note(const RitzValues& solve) {
  if (solve.count() == 0) return;
  if (smallest_.size() == kSolvesKept) {
    smallest_.erase(smallest_.begin());
    largest_.erase(largest_.begin());
    long_enough_.erase(long_enough_.begin());
  }
  smallest_.push_back(solve.smallest());
  largest_.push_back(solve.largest());
  long_enough_.push_back(is_long_enough(solve) ? 1 : 0);
}

Spectrum SpectrumEstimate::estimate(const RitzValues& running) const {
  Spectrum spectrum{std::numeric_limits<double>::infinity(), 0};
  for (const double one : smallest_) spectrum.smallest = std::min(spectrum.smallest, one);
  for (const double one : largest_) spectrum.largest = std::max(spectrum.largest, one);
  bool known = std::find(long_enough_.begin(), long_enough_.end(), 1) != long_enough_.end();
  if (running.count() > 0) {
    spectrum.smallest = std::min(spectrum.smallest, running.smallest());
    spectrum.largest = std::max(spectrum.largest, running.largest());
    known = known || is_long_enough(running);
  }
  if (!known) spectrum.smallest = 0;
  return spectrum;
}

}  // namespace varimesh
