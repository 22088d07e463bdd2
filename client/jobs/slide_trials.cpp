#include "client/jobs/slide_trials.h"

#include <fmt/format.h>

namespace varimesh::client {
namespace {

/// Why another way is tried.
std::string reason(const v1::SlideTrial& trial) {
  if (trial.left_before() == 1) return "1 element is not certified valid";
  if (trial.left_before() > 1) return fmt::format("{} elements are not certified valid", trial.left_before());
  return fmt::format("The smallest scaled Jacobian is only {:.2g}", trial.min_scaled_jacobian_before());
}

std::string together(const v1::SlideTrial& trial) {
  const bool are_left = trial.left_before() > 0;
  if (trial.outcome() == v1::SlideTrial::OUTCOME_RUNNING)
    return reason(trial) + ", so now all nodes move together (--slide coupled).";
  if (trial.outcome() == v1::SlideTrial::OUTCOME_NO_BETTER)
    return std::string(are_left ? "With that, no fewer elements are invalid"
                                : "With that, the smallest scaled Jacobian is no larger") +
           ", so the result stays as it was.";
  return std::string(are_left ? "With that, fewer elements are invalid"
                              : "With that, the smallest scaled Jacobian is larger") +
         ", so this result is taken. The boundary may lie farther from the model now; --slide all never does this "
         "step.";
}

std::string without_sliding(const v1::SlideTrial& trial) {
  if (trial.outcome() == v1::SlideTrial::OUTCOME_RUNNING)
    return reason(trial) + ", so now without sliding, for comparison.";
  if (trial.outcome() == v1::SlideTrial::OUTCOME_NO_BETTER) return "The result is no better without sliding.";
  return "The result is better without sliding, so its boundary nodes have not slid.";
}

/// If nodes slid on the mesh's own boundary: that is always compared with a run without sliding.
std::string on_boundary(const v1::SlideTrial& trial) {
  return trial.outcome() == v1::SlideTrial::OUTCOME_RUNNING ? "Now without sliding." : without_sliding(trial);
}

}  // namespace

std::string trial_text(const v1::SlideTrial& trial, const v1::Geometry& geometry) {
  if (trial.outcome() == v1::SlideTrial::OUTCOME_FAILED)
    return "varimesh: " + trial.error() + "\nThat could not be tried, so the result stays as it was.";
  if (trial.outcome() != v1::SlideTrial::OUTCOME_RUNNING && trial.outcome() != v1::SlideTrial::OUTCOME_TAKEN &&
      trial.outcome() != v1::SlideTrial::OUTCOME_NO_BETTER)
    return "";
  if (geometry.slide_on() == v1::Geometry::SLIDE_ON_BOUNDARY) return on_boundary(trial);
  return trial.slide() == v1::SlideTrial::SLIDE_COUPLED ? together(trial) : without_sliding(trial);
}

}  // namespace varimesh::client
