// The stored symmetric quadrature rules for simplices.
#pragma once

#include <span>

namespace varimesh::reference {

/// A stored rule: one row of dimension + 1 numbers per point, its reference coordinates and its weight.
struct StoredRule {
  int degree;
  std::span<const double> rows;
};

/// The rules for triangles and for tetrahedra, by ascending degree and number of points.
std::span<const StoredRule> triangle_rules();
std::span<const StoredRule> tetrahedron_rules();

}  // namespace varimesh::reference
