#include "core/forecast/past_forecasts.h"

#include <algorithm>
#include <cmath>

namespace varimesh {
namespace {

constexpr double kPart = 0.5;   ///< of the time so far, which is looked at
constexpr double kShare = 0.9;  ///< of that part, in which forecasts must have been right

bool is_right(double said, double left) {
  const bool is_near = std::abs(said - left) <= PastForecasts::kSeconds;
  return is_near || (said <= PastForecasts::kFactor * left && left <= PastForecasts::kFactor * said);
}

}  // namespace

void PastForecasts::add(double now, double left) {
  if (!said_.empty() && said_.back().at >= now) said_.pop_back();
  said_.push_back({now, left});
  // The forecast that stood at the beginning of the part is kept.
  while (said_.size() > 2 && said_[1].at <= kPart * now) said_.pop_front();
}

bool PastForecasts::agree() const {
  if (said_.size() < 2) return true;
  const Said& last = said_.back();
  double right = 0, all = 0;
  for (std::size_t i = 0; i + 1 < said_.size(); ++i) {
    const double from = std::max(said_[i].at, kPart * last.at), until = said_[i + 1].at;
    if (until <= from) continue;
    const double middle = (from + until) / 2;
    all += until - from;
    if (is_right(said_[i].left - (middle - said_[i].at), last.at + last.left - middle)) right += until - from;
  }
  return right >= kShare * all;
}

}  // namespace varimesh
