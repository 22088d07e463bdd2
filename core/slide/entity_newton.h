// Newton's method for the nodes of one curve (d = 1) or surface (d = 2), which slide on it. Internal to core/slide.
#pragma once

#include <cstdint>
#include <vector>

#include "core/association/association.h"
#include "core/base/team.h"
#include "core/slide/entity_form.h"

namespace varimesh::detail {

/// What a slide came to.
struct EntitySlide {
  std::vector<EntityNode> nodes;
  int iterations = 0;
  double farthest = 0;  ///< The largest movement of a node over the distance between nodes there.
  std::int64_t folded_before = 0, folded_after = 0;  ///< Elements with J ≤ 0 at a point.
};

/// Moves the free ones of these nodes to lower the energy (entity_energy.h).
///
/// A step solves for the displacements T q of the free nodes with T an orthonormal basis of the tangents: one tangent
/// on a curve, two on a surface. Then the parameters change by (SᵀS)⁻¹ Sᵀ T q with S the first derivatives, and the
/// node is put on the entity there. No node moves by more than half the distance between nodes in one step. While an
/// element is folded at a point where a free node changes F, all have the same δ (falling_delta); after that δ = 0. If
/// such a fold stays, a second attempt has twice as many iterations and a δ that falls more slowly.
///
/// @param at_start         coordinates of all nodes of the mesh as they came, which set the targets
/// @param most_iterations  0: only count the folded elements
/// @param team             shares the elements of one entity, too; its stop token may throw Interrupted
EntitySlide slide_on_curve(int curve, const std::vector<EntityElement>& elements, int order,
                           const Association& association, const std::vector<double>& at_start,
                           std::vector<EntityNode> nodes, int most_iterations, const Team& team);
EntitySlide slide_on_surface(int surface, const std::vector<EntityElement>& elements, int order,
                             const Association& association, const std::vector<double>& at_start,
                             std::vector<EntityNode> nodes, int most_iterations, const Team& team);

}  // namespace varimesh::detail
