// Raising in the middle of a run, before cells are untangled.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/problem/problem.h"
#include "core/solvers/guard/guard.h"
#include "core/solvers/maxmin/raise.h"

namespace varimesh {

/// The first part of untangling: small patches around cells that are not certified in the guard's kept state are made
/// valid by raise_low_cells(). It takes a few steps per patch where a patch of untangling takes many. Every cell is
/// tried once in a run.
///
/// All references must outlive the object. Call everything inside team.run(). The result does not depend on the number
/// of threads.
class KeptRaiser {
 public:
  KeptRaiser(const HighOrderMesh& mesh, Problem& problem, Guard& guard, const Team& team)
      : mesh_(mesh), problem_(problem), guard_(guard), team_(team) {}

  struct Outcome {
    double residual = 0;            ///< The longest move of a node in units of the cells' size around it.
    std::int64_t active_nodes = 0;  ///< Free nodes of the cells that have moved.
    bool tried = false;             ///< At least one patch was tried.
    bool finished = false;          ///< There is nothing more to try.
  };
  /// Moves the problem's nodes to the kept state and raises about a second's worth of patches. The caller must drop the
  /// deformation gradients before, and let the guard certify the mesh afterwards.
  Outcome step();

  /// From where the problem's nodes are, after Guard::certify_moved(): raises the cells that have lost their
  /// certificate (Guard::lost()), and those below the aim (RaiseTask). All others keep their
  /// certificates. `most_looks`: as in raise_low_cells(). Returns whether nodes have moved. The caller must do the same
  /// as after a step.
  bool raise_lost(double aim = 0, std::int64_t most_looks = 0);

  /// What was tried.
  RaiseMemory take_memory() { return std::move(memory_); }

  /// Reads or writes what is remembered between steps.
  template <class Archive>
  void state(Archive& archive) {
    archive(memory_.tried, memory_.level, memory_.shift, memory_.looks);
    if constexpr (Archive::kReads) {
      const auto fits = [&](std::size_t size) { return size == 0 || size == static_cast<std::size_t>(problem_.cells); };
      const std::size_t cells = memory_.tried.size();
      if (!fits(cells) || memory_.level.size() != cells || memory_.shift.size() != cells) archive.fail();
    }
  }

 private:
  /// Brings the problem's nodes from some coordinates to others.
  void take(const std::vector<double>& from, const std::vector<double>& to, Outcome& outcome);
  /// By node: fixed in the problem.
  std::vector<bool> fixed() const;

  const HighOrderMesh& mesh_;
  Problem& problem_;
  Guard& guard_;
  const Team& team_;
  RaiseMemory memory_;
};

}  // namespace varimesh
