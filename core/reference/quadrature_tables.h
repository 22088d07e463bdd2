// The stored symmetric quadrature rules of simplices.
#pragma once

#include <span>

namespace varimesh::reference {

/// A stored rule: rows of dimension + 1 numbers, the point's reference coordinates and its weight.
struct StoredRule {
  int degree;
  std::span<const double> rows;
};

/// Rules of triangles and of tetrahedra, by ascending degree (and number of points).
std::span<const StoredRule> triangle_rules();
std::span<const StoredRule> tetrahedron_rules();

}  // namespace varimesh::reference
