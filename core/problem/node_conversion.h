// Between the file's equispaced nodes in the user's unit of length and the solver's optimised ones in relative
// coordinates.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/problem/problem.h"
#include "core/reference/nodes.h"

namespace varimesh {

/// The relative coordinates: (x − centre)/diagonal of the bounding box of all nodes.
struct Frame {
  std::array<double, 3> centre{};
  double diagonal = 1;
};

Frame frame_of(const HighOrderMesh& mesh);

/// Whether a cell's part (vertex, edge, face, interior) belongs to `whole` or bounds it: whether what happens to a node
/// in `part` moves equispaced nodes in `whole`.
bool in_closure(const reference::ShapeInfo& shape, reference::NodePlace part, reference::NodePlace whole);

/// Positions (mesh.dimension a node, interleaved) of the optimised nodes, relative to the frame, by exact interpolation
/// in the cells. Nodes that no cell has keep their own.
std::vector<double> solver_positions(const HighOrderMesh& mesh, const Frame& frame);

/// The mesh's coordinates as its optimised nodes move, for all cells or for some.
///
/// What did not move comes back verbatim, since displacements are converted and not positions: a node's coordinates
/// change only where a node of the vertex, edge, face or cell that it lies in has moved. z of a 2-D mesh is kept.
class NodeConversion {
 public:
  /// `before`: solver_positions of the mesh, of which a copy is kept, as is a reference to the mesh.
  NodeConversion(const HighOrderMesh& mesh, const Frame& frame, std::vector<double> before);

  /// Sets the coordinates of the nodes that these cells give (numbers in the mesh's order) for optimised nodes at
  /// `after`. A node's coordinates are given by the first of its cells; so after nodes have moved, call it for every
  /// cell that has one of them. `coordinates` is 3 a node, as HighOrderMesh::coordinates.
  void update(const std::vector<double>& after, std::span<const std::int32_t> cells, std::vector<double>& coordinates,
              const Team& team) const;

 private:
  struct Term {
    int node;  ///< Of the cell.
    double factor;
  };
  struct Rows {  ///< The conversion of one shape without its zeros: a row a node of the cell.
    std::vector<int> begin;
    std::vector<Term> terms;
  };
  struct Cell {
    const std::int32_t* nodes;
    const Rows* rows;
  };

  template <std::size_t d>
  void update_cell(const double* after, std::int32_t number, double* coordinates) const;

  const HighOrderMesh& mesh_;
  double diagonal_;
  std::vector<double> before_;
  std::map<std::pair<Shape, int>, Rows> rows_;
  std::vector<Cell> cells_;
  std::vector<std::int32_t> owned_begin_;  ///< cells + 1
  std::vector<std::int16_t> owned_;        ///< Nodes of a cell whose coordinates it gives.
};

/// All of the mesh's coordinates after its optimised nodes went from `before` to `after`.
std::vector<double> file_coordinates(const HighOrderMesh& mesh, const Frame& frame, const std::vector<double>& before,
                                     const std::vector<double>& after);

}  // namespace varimesh
