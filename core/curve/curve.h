// Curves a straight mesh: raises its order and puts the new boundary nodes on its geometry. Internal to the library.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/association/association.h"

namespace varimesh {

/// What became of the new nodes.
struct CurveReport {
  std::int64_t on_curves = 0;    ///< New nodes on curves.
  std::int64_t on_surfaces = 0;  ///< New nodes on surfaces.
  std::int64_t in_layers = 0;    ///< New nodes inside the mesh that follow the boundary through thin elements.
  std::int64_t held = 0;         ///< New boundary nodes that stay, since it is not sure where they belong.
  std::vector<int> held_tags;    ///< Tags of the mesh's surfaces that have such nodes, sorted.
  std::int64_t straight = 0;     ///< Boundary elements with such new nodes although the boundary is curved there.
  std::int64_t outside = 0;  ///< New nodes on a surface but outside its boundary or in a hole: the mesh is too coarse.
  /// The geometry's surfaces that have such nodes, by tag: "5", or "5 'Fillet'" if it has a name.
  std::vector<std::string> outside_surfaces;

  /// Sentences for a person.
  std::vector<std::string> sentences() const;
};

struct CurvedMesh {
  HighOrderMesh mesh;
  Association association;  ///< Of the new mesh.
  CurveReport report;
};

/// A mesh of order `order` (2 or more) with the vertices and elements of `linear`, a mesh of order 1:
///
/// 1. Some edges lie on a curve: those between two surfaces, those at the end of a surface, and those where the same
///    surface ends on both sides. Such an edge takes the shortest piece of a curve between its ends. Its nodes are
///    evenly spaced by arc length.
/// 2. Any other edge of a surface element lies on this surface. Each node is the foot of the middle of its neighbours,
///    so the edge is nearly a geodesic, and the chords between its nodes are nearly equal.
/// 3. Nodes inside surface elements are blended from the edges (blend.h) and projected.
/// 4. Edges and faces of thin quadrilaterals, prisms and hexahedra move as their opposite edge or face, from the
///    boundary inwards: layers keep their heights. On a surface the nodes are projected.
/// 5. The other nodes inside the mesh are blended from those around them.
///
/// Vertices stay. No parameter of a surface decides where a node goes, so that uneven parameters do no harm. Elements
/// may be invalid, if the boundary bends by as much as they are high. Errors: those of change_order().
/// The result does not depend on the number of threads. Call it inside team.run().
Expected<CurvedMesh> curve(const HighOrderMesh& linear, const Association& association, int order, const Team& team);

}  // namespace varimesh
