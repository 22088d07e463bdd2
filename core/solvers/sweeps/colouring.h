// The colouring: the order in which a sweep visits the free nodes. Colours come one after another; the groups of a
// colour are visited in parallel.
#pragma once

#include <cstdint>
#include <vector>

#include "core/options/options.h"
#include "core/problem/problem.h"

namespace varimesh {

/// Groups of free nodes, sorted by colour. Two groups of one colour share no cell, so they can move at the same time.
/// The nodes of a group are visited one after another. The order depends only on the mesh's topology and numbering, not
/// on the coordinates or the number of threads.
struct ColouredNodes {
  std::vector<std::int32_t> nodes;    ///< Ranks in Problem::free, group by group.
  std::vector<std::int32_t> groups;   ///< groups + 1: where each group's nodes begin in `nodes`.
  std::vector<std::int32_t> colours;  ///< colours + 1: where each colour's groups begin in `groups`.

  std::size_t colour_count() const { return colours.size() - 1; }
  std::size_t group_count() const { return groups.size() - 1; }
};

/// Colours the free nodes. Colouring::Node is that of the paper (section 3.4): take an uncoloured node, give it the
/// colour, strike out every node of the cells it belongs to, and go on with the rest until none is left; then start the
/// next colour with the nodes that were struck out. So each node gets the first colour that no node before it with a
/// common cell has, and the nodes come in the order of first_fit.h. Colouring::Group does the same with all nodes of a
/// cluster of cells as one group. Its nodes are visited place by place (the interior of a cell, a face, an edge, a
/// vertex). This needs few colours, and the deformation gradients of a cluster are read from memory once per sweep
/// instead of once per colour. Call it inside team.run().
ColouredNodes colour_nodes(const Problem& problem, Colouring colouring, const Team& team = Team(1));

}  // namespace varimesh
