// Which phase comes next, and when to stop.
#pragma once

#include <cstdint>
#include <optional>

#include "core/optimise/optimiser.h"

namespace varimesh {

/// What is still to be hoped for.
enum class Outlook : std::uint8_t {
  Nothing,        ///< The present phase has had its time, and no other is to come.
  Patience,       ///< The present phase may still bring something.
  AnotherMethod,  ///< Another phase is to come for what is not certified.
};

/// Which phase comes next. Method::Auto sweeps until every cell that can be is certified valid, or until so many sweeps
/// brought no more of them, and goes on with Newton; where a Newton step finds no lower energy, a few sweeps get it off
/// the spot. Where Newton, too, brings no more of them, the rest is untangled, and Newton goes on from there. Where a
/// valid mesh is all that is asked for, untangling comes before Newton.
class PhaseChooser {
 public:
  PhaseChooser(const Options& options, std::int64_t repairable)
      : method_(options.method), until_(options.until), fewest_(repairable) {
    if (method_ == Method::Newton || (method_ == Method::Auto && repairable == 0)) turn_to(Phase::Newton, patience_);
  }

  Phase phase() const { return phase_; }

  /// After an iteration: false where nothing is left to try. `repairable` and `unrepaired` as the guard has them.
  /// `stuck`: it found no lower energy, or has converged; untangling: it has come to its end.
  bool next(std::int64_t repairable, std::int64_t unrepaired, bool stuck);

  /// Untangling begins with so many cells.
  void untangling_from(std::int64_t unrepaired);

  /// What may still bring certificates. Untangling is tried again only where it has brought some.
  Outlook outlook(std::int64_t unrepaired) const;

  template <class Archive>
  void state(Archive& archive) {
    archive(phase_, fewest_, untangled_from_, fewest_before_, times_untangled_, newton_tried_, patience_, times_stuck_);
  }

 private:
  /// Whether untangling has not been tried, or has brought some and may bring more.
  bool may_untangle(std::int64_t unrepaired) const;
  void turn_to(Phase phase, int patience);

  Method method_;
  Until until_;
  Phase phase_ = Phase::Sweeps;
  std::int64_t fewest_;
  std::int64_t untangled_from_ = -1;  ///< Unrepaired cells when untangling last began,
  std::int64_t fewest_before_ = -1;   ///< and fewest_ then.
  int times_untangled_ = 0;
  bool newton_tried_ = false;
  int patience_ = 10;  ///< Iterations without fewer uncertified cells.
  int times_stuck_ = 0;
};

/// Whether an iteration was the last.
class Stopper {
 public:
  explicit Stopper(const Options& options) : options_(options) {}

  /// Asked after every iteration, before it starts with iteration 0 as things are. `bound`: the proved minimum of the
  /// scaled Jacobian, asked for with until_js alone. Lack of progress ends a run where the outlook is nothing,
  /// convergence where no other method is to come.
  std::optional<StopReason> after(const Iteration& iteration, bool converged, Outlook outlook, double bound);

  template <class Archive>
  void state(Archive& archive) {
    archive(fewest_, without_fewer_);
  }

 private:
  const Options& options_;
  std::int64_t fewest_ = -1;
  int without_fewer_ = 0;
};

}  // namespace varimesh
