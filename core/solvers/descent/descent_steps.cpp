// The steps of a round, on the processor or on a device.
#include <optional>
#include <utility>

#include "core/device/run_device.h"
#include "core/solvers/descent/descent.h"
#include "core/solvers/descent/on_device/device_loss.h"

namespace varimesh {
namespace {

/// Newton steps of a round that move a node by more than this are followed by another one. Shorter ones are not: the
/// next round has other frames.
constexpr double kLongStep = 0.1;
/// Nor are steps that lower the objective by less than this share of what the round has lowered it by so far: in cells
/// that are thin in several directions, nodes move far and change nothing.
constexpr double kLittle = 0.02;
constexpr int kMostSteps = 8;
/// Of a step. More of them lead no farther: on hoipc__armadillo_P4, the first six rounds with at most 300 have 1.7
/// times the products and end at a higher loss.
constexpr int kMostProducts = 100;
constexpr int kFewProducts = 3;
/// In meshes that keep invalid cells, nearly all systems have directions of negative curvature, and the line search
/// took a hundredth of the steps. With the convex part it takes half of them or all.
constexpr double kConvexBelow = 0.25;

}  // namespace

void Descent::minimise(DescentRound& round) {
  NewtonRules rules;
  rules.most_products = kMostProducts;
  rules.few_products = kFewProducts;
  rules.convex_below = kConvexBelow;
  begin_on_device();
  std::optional<NewtonMethod> method;
  if (on_device_)
    method.emplace(*on_device_, rules);
  else
    method.emplace(objective_, rules);

  double fall = 0;
  for (int number = 0; number < kMostSteps; ++number) {
    const NewtonOutcome outcome = step(method, round);
    if (first_gradient_ == 0) first_gradient_ = outcome.gradient_norm;
    round.steps += outcome.products;
    round.relative_gradient = first_gradient_ > 0 ? outcome.gradient_norm / first_gradient_ : 0;
    fall += outcome.before - outcome.after;
    const bool is_short = outcome.damping == 1 && outcome.residual <= kLongStep;
    if (outcome.damping == 0 || is_short || outcome.before - outcome.after <= kLittle * fall) break;
  }
  round.residual = objective_.largest_from(accepted_);
}

Descent::~Descent() = default;

void Descent::begin_on_device() {
  try {
    device::Device* const there = context_.device == nullptr ? nullptr : context_.device->get();
    if (there != nullptr && std::exchange(tries_device_, false))
      on_device_ = std::make_unique<DeviceLoss>(*there, problem_, barrier_, form_, levels_, context_.material, team_);
    if (on_device_) on_device_->begin_round(objective_.hold(), from_);
  } catch (const DeviceFailed& failed) {
    leave_device(failed.fault);
  }
}

NewtonOutcome Descent::step(std::optional<NewtonMethod>& method, DescentRound& round) {
  if (!on_device_) return method->step();
  const NewtonMethod before = *method;
  try {
    const NewtonOutcome outcome = method->step();
    context_.device->begin();
    round.on_device = true;
    return outcome;
  } catch (const DeviceFailed& failed) {
    leave_device(failed.fault);
  }
  // A step moves the nodes only when it has succeeded, so they are where it began.
  objective_.forget_form();
  method.emplace(objective_, before);
  return method->step();
}

void Descent::leave_device(const device::Fault& fault) {
  context_.device->give_up(fault);
  on_device_.reset();
}

}  // namespace varimesh
