// Factors between units of length. Internal to core/association.
#pragma once

#include <cmath>

namespace varimesh::detail {

/// Factors between usual units of length.
inline constexpr double kFactors[] = {1,      1e-3,       1e3,   1e-2,   1e2,       1e-1,       10,   25.4, 1 / 25.4,
                                      0.0254, 1 / 0.0254, 304.8, 0.3048, 1 / 304.8, 1 / 0.3048, 1e-6, 1e6};

/// The factor by which a geometry must be scaled to have nearly the size of the mesh; 1 if none makes it so.
inline double unit_factor(double mesh_size, double geometry_size) {
  double best = 1, least = 0.1;  // samples of curved surfaces miss a little of the box
  for (const double factor : kFactors) {
    const double off = std::abs(std::log(mesh_size / (factor * geometry_size)));
    if (off >= least) continue;
    best = factor;
    least = off;
  }
  return best;
}

}  // namespace varimesh::detail
