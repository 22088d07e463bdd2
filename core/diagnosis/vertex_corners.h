// Every fixed vertex of a 3-D mesh, with the corners of the cells around it. Internal to the library.
#pragma once

#include <map>
#include <utility>
#include <vector>

#include "core/diagnosis/vertex_link.h"
#include "core/mesh/connectivity.h"

namespace varimesh::detail {

/// Sorts the corners of all cells by vertex, once.
class VertexCorners {
 public:
  /// @param fixed by node of the mesh
  /// @param sign −1 if the mesh is numbered clockwise; the corners are then reversed
  VertexCorners(const HighOrderMesh& mesh, const Cells& cells, const std::vector<bool>& fixed, double sign);

  /// The number of fixed vertices.
  std::size_t vertices() const { return nodes_.size(); }

  /// The directions and corners at the i-th fixed vertex.
  struct Link {
    std::int32_t node = 0;
    std::vector<std::int32_t> ends;  ///< The vertex at the other end of each direction.
    std::vector<LinkDirection> directions;
    std::vector<LinkCorner> corners;
  };
  Link link(std::size_t i) const;

 private:
  /// An edge at a local vertex: the cell's nodes along it, from the vertex on.
  struct LocalEdge {
    std::vector<int> nodes;
  };
  /// The edges at each local vertex of a shape and order, counter-clockwise.
  using LocalCorners = std::vector<std::vector<LocalEdge>>;
  struct Incidence {
    std::int32_t cell;
    std::int32_t vertex;  // local
  };
  static LocalCorners local_corners(Shape shape, int order);

  const HighOrderMesh& mesh_;
  const Cells& cells_;
  const std::vector<bool>& fixed_;
  double sign_;
  std::map<Shape, LocalCorners> local_;
  std::vector<double> end_derivative_;  // of the Lagrange basis on a line, at its first end
  std::vector<std::int32_t> nodes_;     // the fixed vertices
  std::vector<std::uint32_t> first_;    // by fixed vertex: the start of its corners in incidences_
  std::vector<Incidence> incidences_;
};

}  // namespace varimesh::detail
