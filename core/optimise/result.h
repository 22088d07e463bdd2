// The result of a run: the mesh, its quality before and after, and why the run ended.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/diagnosis/diagnosis.h"
#include "core/diagnosis/remedies.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/iteration.h"
#include "core/quality/quality.h"
#include "core/repair/repair_step.h"

namespace varimesh {

/// Why a run ended.
enum class StopReason : std::uint8_t {
  Converged,   ///< Every free node is within the tolerance of the optimum; with Method::Sweeps: the residual is at most
               ///< the tolerance; with Objective::Accuracy: another run would lower the loss by less than 1 %.
  Valid,       ///< Until::Valid: every cell is certified valid.
  Repaired,    ///< Until::Valid: every cell that is not certified valid is unrepairable.
  NoProgress,  ///< Until::Valid: no fewer uncertified cells after ten iterations. Or: no lower energy was found, or
               ///< rounding keeps the residual above the tolerance. Objective::Accuracy: the rounds gained no more, but
               ///< had not come to rest, or the mesh is one on the way to where they did.
  Quality,     ///< until_js is reached.
  TimeLimit,   ///< time_limit is reached.
  Iterations,  ///< max_iterations is reached.
  Stopped,     ///< The caller returned Control::Stop, or RunControl::stop_asked said yes.
  /// Newton steps reached the largest number of products again and again before the run converged: the preconditioner
  /// does not fit the energy (a very large λ). The mesh is the best so far, but not the optimum.
  MostProducts,
};

/// Whether the methods ended the run, and not a limit or the caller.
inline bool ended_by_itself(StopReason reason) {
  return reason == StopReason::Converged || reason == StopReason::NoProgress || reason == StopReason::MostProducts;
}

/// Sizes of a mesh, and how many of its nodes would move.
struct MeshSummary {
  int dimension = 0;
  int order = 0;
  std::int64_t elements = 0;    ///< Cells of the highest dimension.
  std::int64_t nodes = 0;       ///< All nodes of the file.
  std::int64_t free_nodes = 0;  ///< Nodes that may move.
};

/// The elements whose straight-sided shape is inverted or nearly flat, so that their target has another shape
/// (core/problem/substitute_shapes.h).
struct SubstituteTargets {
  std::vector<std::int64_t> elements;  ///< Element numbers of the resulting mesh, in its order.
  std::string sentence;                ///< For humans; empty if there are none.
};

/// Everything that a run says about itself, without the mesh.
struct RunSummary {
  MeshSummary sizes;  ///< Of the input mesh, in the order in which it was optimised.
  int iterations = 0;
  int resumed_from = 0;      ///< The iteration whose checkpoint the run went on from; 0 if it began at the beginning.
  double seconds = 0;        ///< From the input mesh to the result in memory, quality reports included.
  double proof_seconds = 0;  ///< The part of `seconds` spent on certificates and on finding what cannot be repaired.
  double residual = 0;       ///< Of the last iteration.
  bool converged = false;    ///< StopReason::Converged says what that means.
  bool stopped = false;      ///< Ended by the caller: StopReason::Stopped.
  StopReason stop_reason = StopReason::Iterations;
  QualityReport before;
  QualityReport after;
  std::vector<UnrepairableGroup> unrepairable;  ///< What no movement of free nodes can repair.
  std::vector<RepairStep> repairs;              ///< What Repair::Split or Straighten did about it, in order.
  SubstituteTargets substitute_targets;
  /// For humans, one sentence or two each: which elements came clockwise, and why nothing was moved. Mostly empty.
  std::vector<std::string> notes;
  WhatIsLeft left;                     ///< The elements of `after` that are not certified valid, and what to try next.
  std::int64_t made_valid_at_end = 0;  ///< Elements that small patches made valid when the iterations had ended.
  std::string device;           ///< The device on which steps of Newton's method were made; empty: the processor.
  std::string kept_as_it_came;  ///< Why the mesh is the input although the run made another; otherwise empty.
  std::vector<Iteration> history;
};

/// The result of a run: its summary, and the mesh.
struct Result : RunSummary {
  /// The input mesh with new coordinates. Fixed nodes have the same coordinates bit for bit. A cell that is certified
  /// valid in the input mesh is certified valid here too, however the run ended. A run could have ended after each of
  /// its iterations. Of the meshes that this would have given, the result is one with the fewest cells that are not
  /// certified valid: the last mesh if it is one of these, otherwise the first. With until_js, and with
  /// Objective::Worst, it is the one of these with the highest proved minimum of the scaled Jacobian. If all cells of
  /// the input mesh are certified valid and the target is the straight-sided shape, the smallest and the mean scaled
  /// Jacobian of `after` are not both lower than those of `before`: otherwise the result is the input mesh. With
  /// Objective::Accuracy the result is the best mesh of the descent (core/solvers/descent/descent.h) instead, or, if a
  /// solver's error in its layers would rise, a mesh on the way to it: if all cells of the input mesh are certified
  /// valid, its loss of accuracy is not above that of the input. With
  /// Repair::Split the mesh may have more elements and nodes, numbered above those of the input. If the input is at its
  /// optimum already or has no free node, it comes back bit for bit. Cells that came clockwise are clockwise here too,
  /// unless Options::orient is set.
  HighOrderMesh mesh;
};

}  // namespace varimesh
