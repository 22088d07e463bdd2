// Moves the vertices of a mesh out of the way of a layer that grows. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/stop_token.h"
#include "core/layers/grow/freedom.h"
#include "core/mesh/connectivity.h"

namespace varimesh::detail {

/// The displacement of a vertex that is known.
struct Push {
  std::int32_t vertex = -1;
  Eigen::Vector3d by;
};

/// The straight-sided mesh as a linear elastic body whose small cells are stiffer: the stiffness of a cell grows as its
/// volume falls (T. E. Tezduyar, M. Behr, S. Mittal, A. A. Johnson, New methods in transient analysis, ASME AMD 143,
/// 1992). Large displacements are made in steps, each from where the last one ended.
class ElasticMove {
 public:
  /// The cells of the mesh must be numbered counter-clockwise.
  ElasticMove(const HighOrderMesh& mesh, const Freedoms& freedoms);

  /// By node: the least height of a cell above it; infinite if it is no vertex of a cell.
  std::vector<double> heights() const;

  struct Outcome {
    /// By node, for vertices of cells.
    std::vector<Eigen::Vector3d> displacements;
    /// Vertices of cells that would be crushed; if there are some, the displacements are of no use.
    std::vector<std::int32_t> crushed;
  };
  /// Moves vertices as the freedoms allow. Those that are pushed need no freedom.
  /// `stop` may be null; between steps it may interrupt this.
  Outcome move(std::span<const Push> pushes, const StopToken* stop) const;

 private:
  /// A simplex on vertices of a cell: the cell itself, or a corner of it.
  struct Corner {
    std::array<std::int32_t, 4> nodes{};
    double weight = 1;
    double quality = 0;  ///< Volume over a power of its size, as the mesh comes.
  };
  using Places = std::vector<Eigen::Vector3d>;

  struct System;

  double quality(const Corner& corner, const Places& at) const;
  int steps(std::span<const Push> pushes) const;
  void number(System& system) const;
  void add(const Corner& corner, const Places& places, System& system) const;
  /// One step from these places, by which they change.
  void step(std::span<const Push> pushes, double share, Places& at) const;

  const Freedoms& freedoms_;
  int dimension_;
  Places came_;  ///< By node.
  std::vector<Corner> corners_;
};

}  // namespace varimesh::detail
