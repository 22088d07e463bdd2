// Takes the boundary of a mesh and the interfaces inside it apart: facets, the surfaces that they form, the curves
// between surfaces, corners. Internal to core/association.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// An element of the boundary or of an interface.
struct BoundaryFacet {
  Shape shape = Shape::Triangle;
  std::vector<std::int32_t> nodes;  ///< Indices of mesh nodes in Gmsh's order.
  int entity = 0;                   ///< Tag of the surface of the file that it belongs to; −1: none.
  bool is_inside = false;           ///< It is an element of an interface: it has cells on both sides.
  std::size_t surface = 0;
};

/// Edges of elements, each of which begins where the one before ends.
struct BoundaryChain {
  std::vector<std::vector<std::int32_t>> lines;  ///< Node indices of each edge, in Gmsh's order.
  std::vector<int> surfaces;                     ///< On whose elements the edges lie, sorted; one may be there twice.
  bool closed = false;
};

/// The parts; own_boundary.h says what is a surface, a curve and a vertex.
class BoundaryParts {
 public:
  /// @param angle above which a joint is not smooth, in radians. Call it inside team.run().
  BoundaryParts(const HighOrderMesh& mesh, double angle, const Team& team);

  std::vector<BoundaryFacet> facets;
  std::size_t surfaces = 0;  ///< How many there are.
  std::vector<BoundaryChain> chains;
  std::vector<std::int32_t> corners;  ///< Node indices, sorted.
  /// By node of the mesh: whether it lies between two regions where no elements say that there is an interface.
  std::vector<bool> held;

  Eigen::Vector3d position(std::int32_t node) const;
  /// 3 × nodes.
  Eigen::Matrix3Xd positions(const std::vector<std::int32_t>& nodes) const;

 private:
  /// An edge of boundary facets.
  struct Edge {
    std::int32_t low, high;  ///< Its ends.
    /// Where it is an edge of which facet, by increasing facet.
    std::vector<std::pair<std::size_t, int>> sides;
    bool smooth = false;
  };
  /// An edge that is part of a curve.
  struct Line {
    std::vector<std::int32_t> nodes;
    std::vector<int> surfaces;
    bool used = false;
  };

  void find_facets_of_volume(const Team& team);
  void find_interfaces(const Facets& of, const Cells& cells, const Cells& elements);
  BoundaryFacet facet_of(const Facets& of, const Cells& cells, std::int32_t facet) const;
  void find_facets_of_surface();
  void find_edges();
  void find_smooth_edges(const Team& team);
  bool is_smooth(const Edge& edge) const;
  void find_surfaces();
  void find_lines();
  void find_corners();
  void find_tips();
  void find_chains();
  void follow(std::size_t line, std::int32_t from);
  Eigen::Vector3d normal(std::size_t facet, const Eigen::Vector2d& at) const;
  bool is_corner(std::int32_t node) const;

  const HighOrderMesh& mesh_;
  const double angle_;
  std::vector<Edge> edges_;
  std::vector<Line> lines_;
  std::vector<std::vector<std::size_t>> lines_at_;  ///< By node: the lines that end there.
};

}  // namespace varimesh::detail
