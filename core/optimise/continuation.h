// The stages of one run, one after another: a single one for Objective::Energy, several for Objective::Worst.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/guard/best_mesh.h"
#include "core/guard/guard.h"
#include "core/optimise/grace.h"
#include "core/optimise/result.h"
#include "core/optimise/run_control.h"
#include "core/optimise/set_up.h"
#include "core/optimise/stage_run.h"
#include "core/solvers/descent/descent.h"
#include "core/solvers/maxmin/raise.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// Everything of a run that lies between the quality reports before and after. Each object is for one run, and
/// everything that its constructor takes must outlive it.
class Continuation {
 public:
  /// `watch` runs since the run began, set-up included.
  Continuation(SetUp& set_up, const Certifier& certifier, const Stopwatch& watch, const OnIteration& on_iteration,
               const RunControl& control, Team& team, Grace& grace);

  /// Runs the stages. `certificates` are of set_up.mesh on entry and of the result's mesh afterwards. It sets only the
  /// coordinates of result.mesh; the rest can be copied once the memory of the run has been freed. Returns false and
  /// changes neither of them if control.checkpoint cannot be used; a run from the beginning needs a new Continuation.
  /// If the token of the run stops it, the result is the best mesh so far. `raised`: what the run tried to raise.
  bool run(std::vector<Certificate>& certificates, Result& result, RaiseMemory& raised);

 private:
  /// The stages, one after another. Returns false if the checkpoint cannot be used.
  bool run_stages(const std::vector<Certificate>& certificates, Result& result);
  /// Makes a new guard, best mesh and stage. `certificates` and `unrepairable` are those of set_up.mesh.
  void set_up_stage(const std::vector<Certificate>& certificates, std::span<const UnrepairableGroup> unrepairable);
  StageContext context();
  std::optional<StopReason> begin(const std::vector<Certificate>& certificates,
                                  std::span<const UnrepairableGroup> unrepairable);
  bool resume(const std::vector<Certificate>& certificates, std::span<const UnrepairableGroup> unrepairable);
  void iterate(Result& result);
  bool has_minimum_to_raise();
  void try_to_end_here();
  double consider();
  bool raised_enough();
  std::optional<StopReason> begin_next_stage();
  /// Objective::Accuracy, after the only stage: the rounds of the descent.
  void lower_loss(Result& result);
  bool can_lower_loss(const Result& result);
  DescentContext descent_context();
  /// The token of the run has interrupted a stage, or the beginning of one.
  void note_interruption(Result& result);
  void finish(std::vector<Certificate>& certificates, Result& result, RaiseMemory& raised);
  bool untangle_lost();
  /// Untangles cells that lost their certificate and that raising has left.
  void untangle_from_here();
  /// Brings the guard's kept state up to date.
  void settle(Result& result);
  void take_mesh(std::vector<Certificate>& certificates, Result& result);
  std::uint64_t fingerprint_of_stage() const;

  SetUp& set_up_;
  const Certifier& certifier_;
  const Stopwatch& watch_;
  const OnIteration& on_iteration_;
  const RunControl& control_;
  Team& team_;
  Grace& grace_;
  Frame frame_;
  std::size_t stage_ = 0;
  std::optional<Guard> guard_;
  std::optional<BestMesh> best_;
  std::optional<StageRun> stage_run_;
  std::optional<Descent> descent_;
  bool came_valid_ = false;               ///< No element was uncertified in the mesh as it came.
  const QualityReport* least_ = nullptr;  ///< DescentContext::least; with other targets the caller asks for a change.
  Descent::State most_accurate_;          ///< Of the descent; without coordinates if there was none.
};

}  // namespace varimesh
