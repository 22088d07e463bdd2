// Which phase of a stage comes next, and when to stop.
#pragma once

#include <cstdint>
#include <optional>

#include "core/optimise/optimiser.h"

namespace varimesh {

/// What may still certify more cells.
enum class Outlook : std::uint8_t {
  Nothing,        ///< The present phase has had its time, and no other will come.
  Patience,       ///< The present phase may still bring something.
  AnotherMethod,  ///< Another phase will come for the uncertified cells.
};

/// Chooses the next phase. Method::Auto sweeps until every cell that can be certified is, or until ten sweeps have
/// certified no more of them. Then it goes on with Newton. If a Newton step finds no lower energy, a few sweeps move
/// the mesh to where one may. If Newton certifies no more cells either, the rest is untangled, and Newton goes on from
/// there. Options::until does not matter, so a run with Until::Valid is the beginning of the run without it.
class PhaseChooser {
 public:
  PhaseChooser(const Options& options, std::int64_t repairable) : method_(options.method), fewest_(repairable) {
    if (method_ == Method::Newton || (method_ == Method::Auto && repairable == 0)) turn_to(Phase::Newton, patience_);
  }

  Phase phase() const { return phase_; }

  /// After an iteration: false if nothing is left to try. `repairable` and `unrepaired` are the guard's. `stuck`: the
  /// iteration found no lower energy or has converged; for untangling: it has come to its end.
  bool next(std::int64_t repairable, std::int64_t unrepaired, bool stuck);

  /// Untangling begins with this many unrepaired cells.
  void untangling_from(std::int64_t unrepaired);

  /// What may still certify more cells. Untangling is tried again only if it has certified some.
  Outlook outlook(std::int64_t unrepaired) const;

  template <class Archive>
  void state(Archive& archive) {
    archive(phase_, fewest_, untangled_from_, fewest_before_, times_untangled_, newton_tried_, patience_, times_stuck_);
  }

 private:
  /// Whether untangling has not been tried, or has certified cells and may certify more.
  bool may_untangle(std::int64_t unrepaired) const;
  void turn_to(Phase phase, int patience);

  Method method_;
  Phase phase_ = Phase::Sweeps;
  std::int64_t fewest_;
  std::int64_t untangled_from_ = -1;  ///< Unrepaired cells when untangling last began.
  std::int64_t fewest_before_ = -1;   ///< fewest_ at that time.
  int times_untangled_ = 0;
  bool newton_tried_ = false;
  int patience_ = 10;  ///< Iterations that may still pass without fewer uncertified cells.
  int times_stuck_ = 0;
};

/// Decides whether an iteration was the last. With Until::Valid a run ends as soon as the mesh is valid, only
/// unrepairable cells are left, or validity is given up: ten iterations have certified no more cells, and the outlook
/// is Nothing. With Objective::Accuracy the phases end at the same iteration, but if the mesh is valid then, they go on
/// until every cell is proved to have Options::min_js. A mesh that comes in valid needs no phase if its cells have it
/// at the quadrature points.
class Stopper {
 public:
  explicit Stopper(const Options& options) : options_(options) {}

  /// Call it after every iteration, and once before the first with iteration 0, the mesh as it is. `bound` is the
  /// proved minimum of the scaled Jacobian; only until_js needs it, and iterations that ask for a proof. Convergence
  /// ends a run only if no other method will come.
  std::optional<StopReason> after(const Iteration& iteration, bool converged, Outlook outlook, double bound);

  /// Whether the proof decides: with Objective::Accuracy, if all cells are valid and have Options::min_js at the
  /// quadrature points, which is cheaper to know.
  bool asks_for_proof(const Iteration& iteration) const;
  /// Whether validity was given up after the last iteration, and not before. It happens once in a run.
  bool has_just_given_up() const { return has_just_given_up_; }

  template <class Archive>
  void state(Archive& archive) {
    archive(fewest_, without_fewer_, has_given_up_);
  }

 private:
  const Options& options_;
  std::int64_t fewest_ = -1;
  int without_fewer_ = 0;
  bool has_given_up_ = false, has_just_given_up_ = false;
};

}  // namespace varimesh
