// What no movement of free nodes can repair, named: by vertex, elements, place and determinant, in sentences.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "core/mesh/high_order_mesh.h"
#include "core/team.h"

namespace varimesh {

/// Elements that stay invalid wherever the free nodes go, because fixed nodes alone decide it.
struct UnrepairableGroup {
  enum class Kind : std::uint8_t {
    Vertex,       ///< One element at a vertex: its edges there are fixed, and their tangents span no volume.
    VertexGroup,  ///< Several elements at a vertex, fenced by three fixed edges, for which the boundary leaves no room.
    Edge,         ///< One element along the edge of two fixed faces: J there depends on fixed nodes only.
    Face,         ///< One element on a face or inside: J there depends on fixed nodes only.
    FoldedFace,   ///< A flat fixed face (in 2-D a straight edge) that folds over itself: J = 0 in its elements.
  };
  Kind kind = Kind::Vertex;
  std::int64_t vertex = 0;             ///< Node number as the file has it; 0 for edges and faces.
  std::vector<std::int64_t> elements;  ///< Element numbers as the file has them.
  std::vector<std::int32_t> cells;     ///< The same elements by their place among the mesh's cells, from 0.
  std::array<double, 3> place{};       ///< Physical coordinates.
  /// Dimensionless. At a vertex, det of the unit tangents of the three edges; along an edge, on a face or inside, J
  /// over the element's largest |J| there; for a folded face the smallest cosine between its normal and its mean
  /// normal, signed by the length of the normal over the largest.
  double determinant = 0;
  std::string sentence;  ///< For humans: what, where and what to do.
};

/// Names them. `fixed` says for every node of the mesh whether it is held (fixed_nodes() of core/mesh/connectivity.h,
/// less those freed by name). Call it inside team.run(); the result is in the order of kinds, then of the mesh, and
/// does not depend on the number of threads.
///
/// - Point condition: at a point of a cell where J depends on fixed nodes only, it has to be positive.
/// - Vertex condition (3-D): at a fixed vertex v, every mesh edge is a direction, its tangent at v, and every cell a
///   spherical triangle of directions. Triangles are joined where they share a side with a free end. A piece fenced by
///   three fixed directions b, c, d fills a solid angle that no free node can change: Ω of the spherical triangle where
///   det(b, c, d) > 0, 4π − Ω where it is negative, with tan(Ω/2) = det / (1 + b·c + c·d + d·b) (A. van Oosterom,
///   J. Strackee, The solid angle of a plane triangle, IEEE Trans. Biomed. Eng. 30, 1983). Pieces of no angle are
///   named. The boundary faces at v leave Ω_v = Σ dihedral angles − (n − 2)π, or 4π inside; where the pieces claim more
///   than that, the largest are named until the rest fits. So the sum decides and not the determinant's sign: at the
///   corner of a cavity a negative one is right.
/// - Folded faces: a flat face whose normal changes sign has points with no normal at all, where J = 0.
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team);

/// The same with fixed_nodes(mesh). `threads` 0 means all.
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, int threads = 0);

}  // namespace varimesh
