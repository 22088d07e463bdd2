// One optimisation, iteration by iteration: which method works next, what is known afterwards, and whether to go on.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/guard/guard.h"
#include "core/newton/newton.h"
#include "core/optimise/optimiser.h"
#include "core/optimise/phases.h"
#include "core/sweeps/sweep.h"
#include "core/untangle/untangle.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// With until_js and Objective::Worst: the best mesh seen, by its proved minimum of the scaled Jacobian; of no use to a
/// mesh that has more uncertified cells than another.
class BestSeen {
 public:
  explicit BestSeen(const Certifier& certifier) : certifier_(certifier) {}

  /// The proved minimum of the guard's kept state; keeps its coordinates where it is the best so far.
  double consider(const Guard& guard);
  const std::vector<double>& coordinates() const { return coordinates_; }
  double highest() const { return highest_; }

  /// The least mean scaled Jacobian that a mesh is to have, for Objective::Worst.
  double floor = -1;

  template <class Archive>
  void state(Archive& archive) {
    archive(highest_, fewest_, coordinates_, floor);
  }

 private:
  const Certifier& certifier_;
  std::vector<Certificate> certificates_;
  std::vector<double> coordinates_;
  double highest_ = -std::numeric_limits<double>::infinity();
  std::int64_t fewest_ = std::numeric_limits<std::int64_t>::max();
};

/// What a run works with. All of it outlives the run.
struct RunParts {
  const Options& options;
  Problem& problem;
  const ColouredNodes& coloured;
  const Kernels& kernels;
  const HessianKernels* hessian;  ///< Null where no Newton step is to come.
  Guard& guard;
  BestSeen& best;
  const Team& team;
};

/// What is to be called inside team.run() says so; the result does not depend on the number of threads, which may be
/// another one every time.
class Run {
 public:
  /// Inside team.run(). `watch` runs since the run began, set-up included.
  Run(const RunParts& parts, const Stopwatch& watch);

  /// What a run leaves to the one that follows it.
  struct Past {
    std::vector<Iteration> history;
    double first_gradient = 0;
    Stopwatch watch;
  };
  Past take_past() { return {std::move(history_), first_gradient_, watch_}; }
  void follow(Past past);

  /// Inside team.run(): looks at things as they are. A reason where there is nothing to be done.
  std::optional<StopReason> begin();
  /// Inside team.run(): goes on behind the iteration that the checkpoint was written after. False where it cannot be
  /// used; then neither can the run and its parts.
  bool resume(std::string_view checkpoint, std::uint64_t fingerprint);
  /// Inside team.run(): one iteration. A reason where it was the last.
  std::optional<StopReason> step();

  /// Whether the state is one that can be written now: the deformation gradients are what the positions alone say.
  bool can_be_kept() const { return exact_; }
  /// Writes it; false where the sink stopped.
  bool write(const CheckpointSink& sink, std::uint64_t fingerprint);

  const Iteration& last() const { return iteration_; }
  bool converged() const { return converged_; }
  double seconds() const { return watch_.seconds(); }
  std::vector<Iteration> take_history() { return std::move(history_); }

 private:
  /// What an iteration of any phase says.
  struct Moved {
    double gradient = 0;
    bool stuck = false;   ///< No lower energy was found, or the phase has come to its end.
    bool failed = false;  ///< The residual says nothing.
    bool whole = true;    ///< Every free node was asked.
  };
  Moved sweep();
  Moved newton_step();
  Moved untangle();
  void look(Moved& moved);
  void note(const Moved& moved);
  std::optional<StopReason> judge(const Moved& moved);
  Newton& newton();

  template <class Archive>
  void state(Archive& archive);
  template <class Archive>
  void methods_state(Archive& archive);

  const Options& options_;
  Problem& problem_;
  const Kernels& kernels_;
  const HessianKernels* hessian_;
  Guard& guard_;
  BestSeen& best_;
  const Team& team_;
  Stopwatch watch_;
  PNorm norm_;
  Sweeper sweeper_;
  PhaseChooser chooser_;
  Stopper stopper_;
  std::optional<Newton> newton_;  ///< Set up when it is first needed.
  std::optional<Untangler> untangler_;
  Iteration iteration_;
  std::vector<Iteration> history_;
  double first_gradient_ = 0;
  int began_ = 0;     ///< Iterations of the stages before this one.
  double bound_ = 0;  ///< The proved minimum of the scaled Jacobian, with until_js alone.
  bool converged_ = false;
  bool exact_ = false;
};

}  // namespace varimesh
