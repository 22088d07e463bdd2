#include "client/io/remaining_time.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/options/option_table.h"

namespace varimesh::client {
namespace {

constexpr std::size_t kRecent = 20;
constexpr double kLeastFall = 0.05;  ///< In decades; below it, the residual counts as standing still.

/// Whether the energy's optimum is asked for, by name or by an option of the energy (core/options/options.h).
bool asks_for_energy(const v1::Options& options) {
  if (options.objective() != v1::OBJECTIVE_UNSPECIFIED && options.objective() != v1::OBJECTIVE_AUTO)
    return options.objective() == v1::OBJECTIVE_ENERGY;
  return std::ranges::any_of(option_table(), [&](const OptionInfo& option) {
    const auto* field = v1::Options::descriptor()->FindFieldByName(std::string(option.name));
    return is_of_energy(option) && v1::Options::GetReflection()->HasField(options, field);
  });
}

void lower(std::optional<double>* estimate, double seconds) {
  *estimate = std::max(0.0, estimate->has_value() ? std::min(**estimate, seconds) : seconds);
}

}  // namespace

RemainingTime::RemainingTime(const v1::Options& options)
    : tolerance_(options.has_tolerance() ? options.tolerance() : 1e-3),
      max_iterations_(options.max_iterations()),
      time_limit_(options.time_limit()),
      has_stages_(!asks_for_energy(options)) {}

void RemainingTime::add(const v1::Iteration& iteration) {
  // In each phase the residual falls at a different rate.
  if (iteration.phase() != latest_.phase()) recent_.clear();
  latest_ = iteration;
  if (iteration.residual() > 0) recent_.push_back({iteration.seconds(), std::log10(iteration.residual())});
  if (recent_.size() > kRecent) recent_.pop_front();
  const std::optional<double> left = estimate();
  forecast_ = left && (!least_ || *left <= *least_) ? left : std::nullopt;
  if (forecast_) least_ = forecast_;
}

std::optional<double> RemainingTime::estimate() const {
  std::optional<double> left;
  if (time_limit_ > 0) lower(&left, time_limit_ - latest_.seconds());
  if (has_stages_ || recent_.size() < 3) return left;
  const double elapsed = recent_.back().seconds - recent_.front().seconds;
  const double steps = static_cast<double>(recent_.size() - 1);
  if (max_iterations_ > 0) lower(&left, elapsed / steps * (max_iterations_ - latest_.number()));
  const double fall = recent_.front().log_residual - recent_.back().log_residual;
  if (fall >= kLeastFall && tolerance_ > 0)
    lower(&left, elapsed * (recent_.back().log_residual - std::log10(tolerance_)) / fall);
  return left;
}

}  // namespace varimesh::client
