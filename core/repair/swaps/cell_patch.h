// A few cells of a mesh as a mesh of their own, which is changed and put back. Internal to the library.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <vector>

#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"
#include "core/repair/node_key.h"
#include "core/repair/repair_step.h"
#include "core/repair/split_rules.h"

namespace varimesh {

/// Triangles or tetrahedra of one block that are taken out of a patch, and others that fill the same room.
struct CellChange {
  RepairStep::Kind kind = RepairStep::Kind::Swapped;
  /// The vertices of the edge or face that disappears. If it collapses, the first one goes to the second.
  std::vector<std::int32_t> place;
  std::vector<std::int32_t> removed;  ///< In ascending order.
  std::vector<VertexNodes> added;     ///< In the orientation of the mesh.
};

/// Cells of a mesh, with the nodes of these cells. Nodes and cells have indices of their own. The blocks are those of
/// the whole mesh, without the cells of others and without elements of lower dimension.
struct CellPatch {
  HighOrderMesh mesh;
  /// By node: the index in the whole mesh; −1 if it is new. Nodes that no cell has any more stay in the list.
  std::vector<std::int32_t> in_whole;
  std::vector<bool> shared;         ///< By node: other cells have it too.
  std::vector<bool> fixed;          ///< By node: shared, or fixed in the whole mesh.
  std::set<SplitPlace> kept;        ///< Edges and faces that must stay.
  std::vector<std::int64_t> taken;  ///< Numbers of the cells that were taken out of the whole mesh, in ascending order.

  /// What was changed, in order. Cells are known by their numbers. New cells have −1, −2, … until they are put back.
  struct Done {
    RepairStep::Kind kind;
    std::vector<std::int64_t> vertices, removed, added;
  };
  std::vector<Done> done;
  std::int64_t new_cells = 0;  ///< How many new cells there have been.
};

/// Takes these cells of a mesh. @param cells  in ascending order
CellPatch take_patch(const HighOrderMesh& whole, const Cells& all, std::span<const std::int32_t> cells,
                     const std::vector<bool>& fixed, const SplitRules& rules);

/// The patch after the change. New edges are straight; new nodes on faces and inside cells follow the edges and faces
/// around them (core/mesh/changes/simplex_blend.h). Other nodes stay.
CellPatch changed(const CellPatch& patch, const CellChange& change);

/// Writes patches into the mesh from which they were taken: the nodes that have moved, and the new cells and nodes. No
/// two patches share a cell. New cells come last in their block, new nodes last in the mesh, with numbers above
/// the highest there is. Nodes that no cell has any more go, and so do fields in sections that VariMesh does not use,
/// because they have no values for what is new. Adds a step for each change.
void put_back(HighOrderMesh& whole, std::span<const CellPatch> patches, std::vector<RepairStep>& steps);

}  // namespace varimesh
