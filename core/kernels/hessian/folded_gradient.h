// The gradient operator of a reference cell, decomposed by the cell's mirror symmetries.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/base/aligned.h"
#include "core/problem/problem.h"

namespace varimesh {

/// ∂φ_n/∂s_α at the quadrature points, where s are the coordinates of reference::mirrors(), as an operator on sums and
/// differences of values.
///
/// The images of one node under the mirrors form an orbit: 2^k nodes if k mirrors move it. The values at the nodes of
/// an orbit, added up with signs, give 2^k components, one for each parity. The parity is the set of the orbit's
/// mirrors that change the signs. The same holds for points. A component at nodes contributes only to components at
/// points of one parity: its own, changed by the mirror that reverses the direction of the derivative. With m mirrors
/// only 2^−m of the dense table is needed. In one direction this is the even-odd decomposition: A. Solomonoff, J.
/// Comput. Phys. 98, 1992.
struct FoldedGradient {
  /// Nodes or points that are images of each other. Member g is the image of member 0 under those of the orbit's
  /// mirrors whose bits are set in g.
  struct Orbit {
    int mirrors = 0;                 ///< k; there are 2^k members.
    std::array<int, 8> member{};     ///< Of nodes: the node. Of points: its slot.
    std::array<int, 8> component{};  ///< Where component g is; the bits of g are its parity.
  };
  /// The components at nodes of one parity, and the components at points that they contribute to.
  struct Parity {
    int first = 0, nodes = 0;       ///< The components at nodes are `first` to `first` + `nodes` − 1.
    std::vector<int> rows;          ///< slot · d·d + α: the component of slot `slot` of derivative α.
    AlignedVector<float> forward;   ///< nodes × rows: the operator.
    AlignedVector<float> backward;  ///< rows × nodes: the same numbers.
  };

  Eigen::MatrixXd directions;       ///< reference::Mirrors::directions: ∇_s = directions · ∇_ξ.
  std::vector<int> points;          ///< The quadrature point in each slot; the points of an orbit are adjacent.
  std::vector<int> slots;           ///< The slot of each quadrature point.
  std::vector<Orbit> node_orbits;   ///< By size.
  std::vector<Orbit> point_orbits;  ///< By size. Components are in their orbit's slots, in the order of their numbers.
  std::vector<Parity> parities;
};

/// The folded gradient of the set's shape, nodes and quadrature rule. It uses those of the shape's mirrors that map the
/// nodes and the points onto themselves.
FoldedGradient fold_gradient(const CellSet& cells);

}  // namespace varimesh
