// Converts file nodes to solver nodes and back. File nodes are equispaced and have the user's unit of length; solver
// nodes are the optimised node set in relative coordinates.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/problem/problem.h"
#include "core/ranks/ranks.h"
#include "core/reference/nodes.h"

namespace varimesh {

/// Relative coordinates are (x − centre)/diagonal, for the bounding box of the nodes that cells of the highest
/// dimension use. Other nodes, such as the centres of arcs, count for nothing.
struct Frame {
  std::array<double, 3> centre{};
  double diagonal = 1;
};

/// Call it inside team.run().
Frame frame_of(const HighOrderMesh& mesh, const Team& team = Team(1));

/// Whether `part` of a cell (a vertex, edge, face or the interior) is `whole` or bounds it. If so, equispaced nodes in
/// `whole` move when an optimised node in `part` does.
bool in_closure(const reference::ShapeInfo& shape, reference::NodePlace part, reference::NodePlace whole);

/// Positions of the optimised nodes in the frame (mesh.dimension numbers per node, interleaved), by exact interpolation
/// in the cells. Nodes that belong to no cell keep their own positions. Call it inside team.run().
std::vector<double> solver_positions(const HighOrderMesh& mesh, const Frame& frame, const Team& team = Team(1));
/// The same with other coordinates (3 per node, as HighOrderMesh::coordinates).
std::vector<double> solver_positions(const HighOrderMesh& mesh, std::span<const double> coordinates, const Frame& frame,
                                     const Team& team);

/// The conversion of the nodes of one shape and order without its zeros: one row per node of the cell.
struct ConversionRows {
  struct Term {
    int node;  ///< Local number in the cell.
    double factor;
  };
  std::vector<int> begin;  ///< nodes + 1: where each row begins in `terms`.
  std::vector<Term> terms;
};

/// Turns positions of the optimised nodes into coordinates of the mesh's own nodes, for all cells or for some.
///
/// It converts displacements and not positions, so the coordinates of a node do not change by a bit unless a node of
/// the vertex, edge, face or cell that it lies in has moved. z of a 2-D mesh is kept.
class NodeConversion {
 public:
  /// Keeps a reference to the mesh. `before`: solver_positions() of the mesh. Call it inside team.run().
  NodeConversion(const HighOrderMesh& mesh, const Frame& frame, const std::vector<double>& before,
                 const Team& team = Team(1));

  /// Sets `coordinates` (3 per node, as HighOrderMesh::coordinates) for optimised nodes at `after`. The first cell of a
  /// node sets its coordinates, so pass every cell that has a node which has moved. `cells`: numbers in the mesh's
  /// order.
  /// @param ranks  all of them have the same mesh, positions and cells, and call it together. Each converts a share of
  /// the cells, and all get all coordinates
  void update(std::span<const double> after, std::span<const std::int32_t> cells, std::span<double> coordinates,
              const Team& team, const Ranks& ranks = one_rank()) const;

 private:
  struct Cell {
    const std::int32_t* nodes;
    const ConversionRows* rows;
  };

  void update_together(std::span<const double> after, std::span<const std::int32_t> cells,
                       std::span<double> coordinates, const Team& team, const Ranks& ranks) const;
  void update_here(std::span<const double> after, std::span<const std::int32_t> cells, std::span<double> coordinates,
                   const Team& team) const;
  /// Calls use(number) for each of the coordinates that these cells set, by its place among all coordinates.
  template <class Use>
  void for_owned(std::span<const std::int32_t> cells, const Use& use) const;
  template <std::size_t d>
  void update_cell(const double* after, std::int32_t number, double* coordinates) const;

  const HighOrderMesh& mesh_;
  double diagonal_;
  UntouchedVector<double> before_;
  std::map<std::pair<Shape, int>, ConversionRows> rows_;
  std::vector<Cell> cells_;
  std::vector<std::int32_t> owned_begin_;  ///< cells + 1: where each cell's entries begin in owned_.
  std::vector<std::int16_t> owned_;        ///< The nodes whose coordinates the cell sets, by local number.
};

/// The coordinates of all nodes of the mesh after its optimised nodes moved from `before` to `after`.
std::vector<double> file_coordinates(const HighOrderMesh& mesh, const Frame& frame, const std::vector<double>& before,
                                     const std::vector<double>& after);

}  // namespace varimesh
