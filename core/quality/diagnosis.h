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
    VertexGroup,  ///< Several elements at a vertex, fenced by fixed edges, for which the boundary leaves no room.
    Edge,         ///< One element along the edge of two fixed faces: J there depends on fixed nodes only.
    Face,         ///< One element on a face or inside: J there depends on fixed nodes only.
    FoldedFace,   ///< A flat fixed face (in 2-D a straight edge) that folds over itself: J = 0 in its elements.
    Fan,          ///< Elements round a free edge at a vertex, whose other edges there are fixed: whichever way the free
                  ///< edge leaves, one of them is not positive.
  };
  Kind kind = Kind::Vertex;
  std::int64_t vertex = 0;             ///< Node number as the file has it; 0 for edges and faces.
  std::vector<std::int64_t> elements;  ///< Element numbers as the file has them.
  std::vector<std::int32_t> cells;     ///< The same elements by their place among the mesh's cells, from 0.
  std::array<double, 3> place{};       ///< Physical coordinates.
  /// Dimensionless. At a vertex, det of the unit tangents of the three edges, or a fan's margin: the largest that the
  /// smallest n · x can be; along an edge, on a face or inside, J
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
///   fixed directions fills a solid angle that no free node can change but by whole spheres: for three b, c, d it is Ω
///   of the spherical triangle where det(b, c, d) > 0, 4π − Ω where it is negative, with tan(Ω/2) = det / (1 + b·c +
///   c·d + d·b) (A. van Oosterom, J. Strackee, The solid angle of a plane triangle, IEEE Trans. Biomed. Eng. 30, 1983);
///   for more the sum of the inner angles less (n − 2)π. Pieces of no angle are named. The boundary faces at v leave
///   Ω_v = Σ dihedral angles − (n − 2)π, or 4π inside; where the pieces claim more than that, one that is turned inside
///   out claims 4π less: named are those that are turned least until the rest fits. So the sum decides and not the
///   determinant's sign: at the corner of a cavity a negative one is right.
/// - Fans: where all edges of a corner at v but one, with direction x, are fixed, its determinant is n · x > 0 with n
///   known. The corners that share x want it in one half-space each; where the half-spaces have nothing in common, the
///   corners are named.
/// - Folded faces: a flat face whose normal changes sign has points with no normal at all, where J = 0.
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const Team& team);

/// Leaves the groups of which an element is among these numbers. Of a group whose elements are all certified valid, one
/// has found a way round its vertex more than once, or another of the vertex's groups is turned in its stead.
std::vector<UnrepairableGroup> with_any_of(std::vector<UnrepairableGroup> groups,
                                           const std::vector<std::int64_t>& numbers);

/// The same with fixed_nodes(mesh). `threads` 0 means all.
std::vector<UnrepairableGroup> diagnose(const HighOrderMesh& mesh, int threads = 0);

}  // namespace varimesh
