// The order in which a sweep visits the free nodes: colours one after another, the groups of a colour in parallel.
#pragma once

#include <cstdint>
#include <vector>

#include "core/options/options.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Groups of free nodes, sorted by colour. Two groups of one colour share no cell, so they can move at the same time;
/// the nodes of a group are visited one after another. The schedule depends on the mesh's topology and numbering alone,
/// so a sweep's result depends neither on threads nor on coordinates.
struct Schedule {
  std::vector<std::int32_t> nodes;    ///< Ranks in Problem::free, group by group.
  std::vector<std::int32_t> groups;   ///< Where each group's nodes begin; one more than there are groups.
  std::vector<std::int32_t> colours;  ///< Where each colour's groups begin; one more than there are colours.

  std::size_t colour_count() const { return colours.size() - 1; }
  std::size_t group_count() const { return groups.size() - 1; }
};

/// Colouring::Node is the paper's (section 3.4): take an uncoloured node, give it the colour, strike out every node of
/// the cells it touches, go on with the rest until none is left; then the next colour on what was struck out.
/// Colouring::Group does the same with the nodes of a whole cluster of cells, which are visited place by place (an
/// element's interior nodes, a face's, an edge's, a vertex): few colours, and a cluster's deformation gradients are
/// fetched from memory once a sweep and not once a colour.
Schedule make_schedule(const Problem& problem, Colouring colouring);

}  // namespace varimesh
