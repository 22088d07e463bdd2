// Holds the boundary near its geometry after all nodes have moved together. Internal to core/slide.
#pragma once

#include "core/slide/coupled/coupled_newton.h"

namespace varimesh::detail {

/// What the distances between boundary and geometry may not exceed, in the mesh's unit of length.
struct DistanceLimit {
  double largest = 0, rms = 0;
  bool allows(const Distances& distances) const { return distances.largest <= largest && distances.rms() <= rms; }
};

/// Puts the nodes between two states, each as far as the limits allow. A node goes the whole way, unless an element of
/// the boundary at it would exceed the largest distance, or be folded and was not at the start. The nodes of such an
/// element go smaller and smaller parts of the way, until the element keeps the limit and is not folded. If the rms
/// distance is too large, the largest one that an element may have becomes smaller, but an element may stay as far as
/// it is at the start. Nodes inside the mesh go the whole way.
///
/// Returns whether the limits hold; then the nodes of `newton` and `boundary` are there. If it finds no such state, for
/// example because the start exceeds the limits, the nodes are somewhere between the two states.
bool hold_back(const CoupledState& start, const CoupledState& end, const DistanceLimit& surfaces,
               const DistanceLimit& curves, CoupledNewton& newton, BoundaryEnergy& boundary);

}  // namespace varimesh::detail
