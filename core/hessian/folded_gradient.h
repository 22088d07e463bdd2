// The gradient operator of a reference cell, taken apart by the cell's mirrors.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/base/aligned.h"
#include "core/problem/problem.h"

namespace varimesh {

/// ∂φ_n/∂s_α at the quadrature points, s the coordinates of reference::mirrors(), as an operator on sums and
/// differences.
///
/// What the mirrors make of one node is an orbit: 2^k nodes where k mirrors move it. Values at an orbit's nodes, added
/// up with signs, are 2^k components, one for each set of its mirrors (its parity) under which the signs change; the
/// same holds for points. A component at the nodes then contributes only to components at the points of the one parity
/// that the derivative makes of it, so that of a dense table 2^−m is left for m mirrors. The even-odd decomposition:
/// A. Solomonoff, J. Comput. Phys. 98, 1992, in one direction.
struct FoldedGradient {
  /// Nodes or points that are each other's images. Member g is the image of member 0 under those of the orbit's
  /// mirrors whose bits are set in g.
  struct Orbit {
    int mirrors = 0;                 ///< k; there are 2^k members.
    std::array<int, 8> member{};     ///< Of nodes: the node. Of points: its slot.
    std::array<int, 8> component{};  ///< Where the component is, whose parity has the bits of its number.
  };
  /// The components at nodes of one parity, and those at points that they contribute to.
  struct Part {
    int first = 0, nodes = 0;       ///< The components are `first` and those after it.
    std::vector<int> rows;          ///< slot · d·d + α: component of slot `slot`, derivative α.
    AlignedVector<float> forward;   ///< nodes × rows.
    AlignedVector<float> backward;  ///< rows × nodes: the same numbers.
  };

  Eigen::MatrixXd directions;       ///< reference::Mirrors::directions: ∇_s = directions · ∇_ξ.
  std::vector<int> points;          ///< The quadrature point in each slot: an orbit's are side by side.
  std::vector<int> slots;           ///< Its inverse.
  std::vector<Orbit> node_orbits;   ///< By size.
  std::vector<Orbit> point_orbits;  ///< By size. Components take their orbit's slots, in the order of their numbers.
  std::vector<Part> parts;
};

/// Of the set's shape, nodes and rule, by as many of the shape's mirrors as leave its points in place.
FoldedGradient fold_gradient(const CellSet& cells);

}  // namespace varimesh
