// Converts the nodes of the file to the Bernstein coefficients of the map, exactly or nearly so. Internal to the
// library.
#pragma once

#include <vector>

#include "core/validity/bernstein.h"

namespace varimesh::detail {

/// Scaled Bernstein coefficients of the Lagrange polynomials of the equispaced nodes (Gmsh's order): one row per
/// coefficient of `space` (the map's), one column per node. Entries that are zero are exactly 0.
///
/// On a simplex the Lagrange polynomial of the node with lattice position α is Π_k Π_{m < α_k} (P λ_k − m)/(α_k − m).
/// With 1 = Σ λ_j each factor is a linear form with integer coefficients. The expansion is therefore exact in 64-bit
/// integers (their sum of absolute values is under (3P)^P < 2^63 for P ≤ 10), and the only roundings are those of one
/// division. Tensor cells have products of these. Pyramids are solved layer by layer in 113-bit arithmetic.
std::vector<std::vector<Quad>> nodes_to_bernstein(Shape shape, int order, const BernsteinSpace& space);

}  // namespace varimesh::detail
