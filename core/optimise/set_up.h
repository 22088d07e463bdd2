// What an optimiser prepares once for a mesh topology, before its first run.
#pragma once

#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/base/stop_token.h"
#include "core/base/team.h"
#include "core/layers/layers.h"
#include "core/mesh/checked_mesh.h"
#include "core/optimise/result.h"
#include "core/optimise/stages.h"
#include "core/options/options.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"
#include "core/problem/target_field.h"
#include "core/solvers/sweeps/colouring.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// A checked mesh with everything that its runs share. It must stay where it is in memory while a run refers to it.
struct SetUp {
  HighOrderMesh mesh;  ///< In the order in which it is optimised, without clockwise cells.
  Facets facets;       ///< Of this mesh.
  /// Layers at curved walls, with Objective::Accuracy. If their nodes were moved, `mesh` has them where they went, and
  /// `as_it_came` the coordinates before; otherwise it is empty.
  LayerStart layers;
  std::vector<double> as_it_came;
  std::vector<char> clockwise;  ///< By cell: 1 if it came clockwise and was turned. Empty if none did.
  Options options;              ///< With the objective that the run has, never Objective::Auto.
  MeshSummary summary;
  std::vector<bool> fixed;  ///< By node of the mesh; with the nodes that layers hold.
  StretchField target;
  /// These three stay empty if there is nothing to iterate here: no iterations are allowed, the set-up was stopped, or
  /// the runs between splits have optimisers of their own.
  Problem problem;
  ColouredNodes coloured;
  std::vector<Stage> stages;
  Objective given_objective = Objective::Auto;  ///< The objective of the options that were given.
  bool may_try_other_ways = false;              ///< may_try_other_ways() of the options that were given.
  bool is_spent = false;                        ///< Its tables were freed for attempts (attempts.h).
  double seconds = 0;  ///< What the set-up took. The first run counts it as its own and sets it to 0.
};

/// Checks the options, turns clockwise cells, changes the order if asked to, colours the nodes and prepares the tables,
/// with options.threads threads. Errors: BadInput, BadOption. If `stop`, which may be null, says so, it leaves out what
/// only iterations need.
Expected<std::unique_ptr<SetUp>> set_up(CheckedMesh&& mesh, const Options& options, const StopToken* stop = nullptr);

/// The same for a mesh that is not checked yet.
Expected<std::unique_ptr<SetUp>> set_up(HighOrderMesh&& mesh, const Options& options, const StopToken* stop = nullptr);

/// Whether the options leave to the run how it makes the mesh valid: they name neither an energy with Objective::Auto
/// nor Objective::Energy, a method, another target than the straight-sided shape, or a repair that changes elements.
bool may_try_other_ways(const Options& options);

/// Sets the targets of the problem, whose positions are those of the mesh in this frame. Returns the cells that do not
/// take their own straight-sided shape. Call it outside team.run().
SubstituteTargets choose_targets(SetUp& set_up, const Certifier& certifier, const Frame& frame, const Team& team);

/// Sizes of the mesh, and how many of its nodes would move. `fixed`: by node. Call it inside team.run().
MeshSummary mesh_summary(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team = Team(1));

}  // namespace varimesh
