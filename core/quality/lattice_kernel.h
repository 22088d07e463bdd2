// det ∇χ_M on a lattice of points, for as many cells at once as a vector has lanes. Internal to the library.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/index.h"
#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/ranks/ranks.h"
#include "core/reference/basis.h"

namespace varimesh::detail {

inline constexpr std::size_t kMostLatticeLanes = 32;
/// Rows of more bytes than this are not kept. Up to order 4 all rows of a shape take less. They are then made for
/// ranges of this size, which stay in cache while several batches of cells are sampled.
inline constexpr std::int64_t kMostLatticeBytes = std::int64_t{4} << 20;

/// Derivatives of the shape functions at a range of a lattice's points.
struct LatticeRows {
  std::size_t first = 0, count = 0;  ///< The points `first` to `first` + `count` − 1.
  std::vector<double> gradients;     ///< ∂(shape function n)/∂ξ_r at point p: [p][n][r].
  std::vector<double> straight;      ///< The same for the vertices' functions of order 1; empty if there are none.
};

/// The lattice of one shape and order. The rows of all points of a hexahedron of order 10 would take 389 MB, so rows
/// are made for a range of points at a time, and kept only if all of them are small.
class LatticeTable {
 public:
  LatticeTable(Shape shape, int order, int intervals, int dimension);

  int dimension() const { return dimension_; }
  int nodes() const { return nodes_; }  ///< Nodes of the cell.
  int vertices() const {
    return vertices_;
  }  ///< Vertices of the straight-sided cell, its first nodes; 0 if its J is
     ///< constant.
  const reference::Points& points() const { return basis_.points(); }
  /// Points in a range, except the last one.
  std::size_t points_per_range() const { return per_range_; }
  std::size_t ranges() const { return (at(points().rows()) + per_range_ - 1) / per_range_; }
  /// The rows of a range: those that are kept, or else those made in `workspace`, which must outlive their use.
  const LatticeRows& rows(std::size_t range, LatticeRows& workspace) const;

 private:
  LatticeRows make_rows(std::size_t range) const;

  int dimension_, nodes_, vertices_ = 0;
  std::size_t per_range_ = 0;
  reference::BasisAtPoints basis_;
  reference::BasisAtPoints linear_;  ///< Of order 1.
  LatticeRows kept_;                 ///< All rows, if there is only one range.
};

/// The table for cells of this shape and order. It is made once and kept until the program ends.
const LatticeTable& lattice_table(Shape shape, int order, int intervals, int dimension);

/// Extremes in one cell. Their signs follow the mesh's numbering.
struct Extremes {
  double low = 0, high = 0, mean = 0;    ///< Values of J.
  std::int32_t low_at = 0, high_at = 0;  ///< Numbers of lattice points.
  /// Values of det ∇χ_M / det ∇χ_L; −1 if the straight-sided cell is itself inverted somewhere, 0 if its J is constant.
  double distortion_low = 0, distortion_high = 0;
};

/// Lanes of the vectors of the machine that this runs on.
std::size_t lattice_lanes();

/// Cells that are sampled together, at most lattice_lanes().
struct LatticeBatch {
  const double* coordinates = nullptr;         ///< x y z of every node of the mesh, interleaved.
  const std::int32_t* const* nodes = nullptr;  ///< The cells' node lists.
  std::size_t cells = 0;
};

/// What the points of a batch that were sampled so far have shown, one lane per cell.
struct LatticeProgress {
  std::array<std::array<double, kMostLatticeLanes>, 9> lanes{};
};

/// Samples one range of points. The ranges of a table must follow one another, from the first to the last. `workspace`
/// is memory that the caller keeps from call to call.
void sample_rows(const LatticeTable& table, const LatticeRows& rows, const LatticeBatch& batch,
                 std::vector<double>& workspace, LatticeProgress& progress);

/// The extremes of the batch's cells, once all ranges were sampled.
void finish_samples(const LatticeTable& table, const LatticeProgress& progress, std::size_t cells, Extremes* out);

/// Samples the cells of a mesh elsewhere than on the processor.
class SamplesElsewhere {
 public:
  virtual ~SamplesElsewhere() = default;
  /// Samples all cells with their nodes at `coordinates` (HighOrderMesh::coordinates). `cells` has one entry per cell
  /// of the mesh. Returns false if it cannot: the processor then has to. The team's token may interrupt it.
  virtual bool sample(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals, const Team& team,
                      std::vector<Extremes>& cells) = 0;
  /// Ranks that all have the mesh and share the other work on its cells, if there are any.
  virtual const Ranks& sharers() const { return one_rank(); }
};

}  // namespace varimesh::detail
