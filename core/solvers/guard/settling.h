// When a later stage of Objective::Worst has raised the lowest scaled Jacobian as far as it will.
#pragma once

#include <algorithm>
#include <limits>

#include "core/merit/thresholds.h"

namespace varimesh {

/// Watches the lowest scaled Jacobian of a stage. At a large λ the first few Newton steps do most of the raising, at a
/// few products each. The optimum itself takes many times as many products, and its lowest scaled Jacobian is often
/// below the lowest scaled Jacobian of meshes on the way. So a stage ends when full steps no longer raise the minimum.
///
/// An iteration does not count while the energy still falls fast or if only a part of the Newton step was taken: the
/// mesh is then still far from where the stage leads, and its minimum goes up and down.
class Settling {
 public:
  /// Call it after every iteration of the stage. True if the stage has settled.
  /// @param lowest the proved minimum of the scaled Jacobian
  /// @param energy Iteration::energy
  /// @param full the whole Newton step was taken
  bool after(double lowest, double energy, bool full) {
    const bool rose = lowest > highest_ + threshold::kLeastRise * (1 - highest_);
    const bool falls = energy < (1 - kFastFall) * energy_;
    if (rose)
      without_rise_ = 0;
    else if (full && !falls)
      ++without_rise_;
    highest_ = std::max(highest_, lowest);
    energy_ = energy;
    return without_rise_ >= kMostWithoutRise;
  }

  template <class Archive>
  void state(Archive& archive) {
    archive(highest_, energy_, without_rise_);
  }

 private:
  static constexpr double kFastFall = 0.05;  // of the energy in one iteration; a looser value ends some stages too low
  // One more step without a rise costs up to 300 products and raises no minimum by more than .0001.
  static constexpr int kMostWithoutRise = 2;

  double highest_ = -1;
  double energy_ = std::numeric_limits<double>::infinity();
  int without_rise_ = 0;
};

}  // namespace varimesh
