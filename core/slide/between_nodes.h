// How far the curved boundary of a mesh lies from its geometry between the nodes. Internal to core/slide.
#pragma once

#include <span>
#include <vector>

#include "core/slide/entity_newton.h"

namespace varimesh::detail {

/// Distances, in the mesh's unit of length.
struct Distances {
  double largest = 0;
  double sum_of_squares = 0;  ///< The mean square of each element.
  double elements = 0;

  double rms() const;
  void add(const Distances& other);
};

/// The distance of the elements to the curve or surface, at points between their nodes (EntityTable::between). The rms
/// is that of a quadrature rule. The largest is looked for on a lattice, and then around its best points on a finer
/// one.
/// @param nodes        the nodes of the elements, sorted by index, with their parameters on the entity
/// @param coordinates  of all nodes of the mesh
/// @param team         shares the elements; the result does not depend on the number of threads
Distances curve_distances(const geometry::CurveShape& shape, std::span<const EntityElement> elements, int order,
                          const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates,
                          const Team& team);
Distances surface_distances(const geometry::SurfaceShape& shape, std::span<const EntityElement> elements, int order,
                            const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates,
                            const Team& team);

}  // namespace varimesh::detail
