// The best mesh that a run has passed through.
#pragma once

#include <cstdint>
#include <vector>

#include "core/merit/merit.h"
#include "core/solvers/guard/guard.h"
#include "core/validity/certifier.h"

namespace varimesh {

/// Keeps the best mesh of a run with until_js or Objective::Worst, which ask for the highest proved minimum of the
/// scaled Jacobian (core/merit/merit.h).
class BestMesh {
 public:
  explicit BestMesh(const Certifier& certifier) : certifier_(certifier) {}

  /// Returns the proved minimum of the scaled Jacobian in the guard's kept state. Keeps the coordinates of that state
  /// if it is the best so far. Call it inside team.run(). If the team's token interrupts it, the best mesh is the same
  /// as before.
  double consider(const Guard& guard, const Team& team = Team(1));

  /// The same in parts, for a caller that asks for more than a high minimum: examine() returns the proved minimum, to
  /// within `gap`, and keep_examined() keeps the state that was examined last. Call examine() inside team.run().
  double examine(const Guard& guard, double gap, const Team& team);
  /// Whether the state that was examined last is better than the best so far.
  bool examined_is_better() const;
  /// Whether every cell is certified valid in it.
  bool examined_is_valid() const { return examined_merit_.uncertified == 0; }
  /// 3 per node, interleaved: the state that was examined last, until it is kept.
  const std::vector<double>& examined() const { return examined_; }
  /// Makes it the best.
  void keep_examined();

  /// 3 per node, interleaved, as HighOrderMesh::coordinates; empty until a state has been considered.
  const std::vector<double>& coordinates() const { return coordinates_; }
  /// Those of the best mesh, one per cell in the mesh's order; empty after a checkpoint was read.
  const std::vector<Certificate>& certificates() const { return best_certificates_; }
  /// Of the best mesh; its minimum is proved.
  const Merit& merit() const { return merit_; }

  /// Objective::Worst: a mesh with a smaller mean scaled Jacobian is not considered.
  double least_mean = -1;

  template <class Archive>
  void state(Archive& archive) {
    archive(merit_.smallest, merit_.uncertified, coordinates_, least_mean);
  }

 private:
  const Certifier& certifier_;
  std::vector<Certificate> certificates_, best_certificates_;
  std::vector<double> examined_, coordinates_;
  Merit examined_merit_, merit_ = Merit::of_nothing();
};

}  // namespace varimesh
