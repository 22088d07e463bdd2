#include "core/merit/merit.h"

#include <algorithm>
#include <tuple>

#include "core/merit/thresholds.h"

namespace varimesh {
namespace {

/// Whether a mesh that came in valid is given up for `a`: it must gain more than next to nothing over `b`, the best so
/// far.
bool is_worth_it(const Merit& a, const Merit& b, double loss_as_it_came) {
  const bool raises = b.smallest < threshold::kWanted && has_higher_minimum(a, b);
  return a.loss <= loss_as_it_came && (a.loss < threshold::kFalls * loss_as_it_came || raises);
}

bool has_less_loss(const Merit& a, const Merit& b, const Asked& asked) {
  if (asked.loss_as_it_came && !is_worth_it(a, b, *asked.loss_as_it_came)) return false;
  if (a.uncertified > 0) return std::tuple(a.loss, -a.smallest) < std::tuple(b.loss, -b.smallest);
  const bool reaches = a.smallest >= asked.bound;
  if (reaches != (b.smallest >= asked.bound)) return reaches;
  if (!reaches) {
    const double least = threshold::kShareOfHighest * std::max({asked.highest_minimum, a.smallest, b.smallest});
    const bool is_high = a.smallest >= least;
    return is_high != (b.smallest >= least) ? is_high : threshold::kLossGivenForMinimum * a.loss < b.loss;
  }
  const double most = threshold::kLossGivenForMinimum * std::min({asked.least_loss, a.loss, b.loss});
  if (a.loss > most || b.loss > most) return a.loss < b.loss;
  const double of_a = std::min(a.smallest, threshold::kWanted), of_b = std::min(b.smallest, threshold::kWanted);
  return std::tuple(-of_a, a.loss, -a.smallest) < std::tuple(-of_b, b.loss, -b.smallest);
}

/// What counts before what is asked for; lower is better.
auto left(const Merit& merit) {
  return std::tuple(merit.lost, merit.weak.value_or(merit.uncertified), merit.uncertified, merit.lower_than_it_came);
}

}  // namespace

Merit Merit::of_nothing() { return {.uncertified = std::numeric_limits<std::int64_t>::max()}; }

Merit merit_of(const QualityReport& report) {
  Merit merit;
  merit.uncertified = static_cast<std::int64_t>(report.uncertified.size());
  merit.smallest = report.min_scaled_jacobian;
  merit.mean = report.mean_scaled_jacobian;
  if (report.accuracy) merit.loss = report.accuracy->loss;
  return merit;
}

Merit merit_of(const CertificateSummary& summary) {
  return {.uncertified = summary.invalid + summary.undecided, .smallest = summary.min_scaled_jacobian_lower_bound};
}

Merit merit_of(const ScaledJacobians& sampled) { return {.smallest = sampled.smallest, .mean = sampled.mean}; }

Asked asked_by(const Options& options) {
  if (options.objective != Objective::Accuracy || options.until == Until::Valid) return kAskForMinimum;
  return {.what = Asked::What::Loss, .bound = options.min_js};
}

bool is_better(const Merit& a, const Merit& b, const Asked& asked) {
  if (left(a) != left(b)) return left(a) < left(b);
  switch (asked.what) {
    case Asked::What::Validity:
      return false;
    case Asked::What::Minimum:
      return a.smallest > b.smallest;
    case Asked::What::Loss:
      return has_less_loss(a, b, asked);
  }
  return false;
}

bool is_lower(const Merit& a, const Merit& b, double margin) {
  return a.smallest < b.smallest - margin && a.mean < b.mean;
}

bool costs_shape(const Merit& a, const Merit& b) {
  return a.smallest < threshold::kWanted && is_lower(a, b, threshold::kHigher);
}

bool has_higher_minimum(const Merit& a, const Merit& b) { return a.smallest > b.smallest + threshold::kHigher; }

bool loses_layers(const QualityReport& as_it_came, const QualityReport& now, const Options& options, double may_rise) {
  const auto &before = as_it_came.in_layers, &after = now.in_layers;
  if (options.layer_spacing != LayerSpacing::Keep || !before || !as_it_came.uncertified.empty()) return false;
  if (!after || after->of_profiles.size() != before->of_profiles.size()) return true;
  return !std::ranges::equal(after->of_profiles, before->of_profiles, [&](double now_missed, double missed) {
    return now_missed <= may_rise * std::max(missed, threshold::kNoErrorInLayers);
  });
}

bool gains_without_loss(const QualityReport& as_it_came, const QualityReport& now, const Options& options) {
  const Merit came = merit_of(as_it_came);
  Merit merit = merit_of(now);
  merit.lower_than_it_came = options.target == Target::StraightSided && costs_shape(merit, came);
  Asked asked = asked_by(options);
  asked.loss_as_it_came = came.loss;
  return merit.loss < threshold::kFalls * came.loss && is_better(merit, came, asked) &&
         !loses_layers(as_it_came, now, options, threshold::kRoundingInLayers);
}

}  // namespace varimesh
