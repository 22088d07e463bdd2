// What the kernels of the descent read and write: maps of all orders on the cells of a mesh, the loss of accuracy as a
// form of such maps, and vectors in double precision.
//
// d is the dimension. The arrays of a set of cells have batches of sixteen cells, the lane innermost. A place is a node
// or a mode of a cell. "Values" of a set are batches × place × d × lane.
#pragma once

#include <cstdint>

namespace varimesh::device {

/// Rows of a matrix that a thread of multiply_cells() multiplies.
inline constexpr int kRowsOfThread = 4;

/// What Places::numbers says in place of the number n of a free node: at the node's second and later places −2 − n, at
/// a fixed node −1.
inline constexpr std::int32_t kFixedNode = -1;
constexpr std::int32_t later_place(std::int32_t number) { return -2 - number; }

/// The values of a vector over the free nodes at the places of a set's cells.
struct GatherArguments {
  std::int32_t batches = 0;
  std::int32_t places = 0;                ///< Of a cell.
  std::int32_t only_first = 0;            ///< Not 0: later places of a node get 0.
  const std::int32_t* numbers = nullptr;  ///< batches × place × lane.
  const double* vector = nullptr;         ///< d per free node.
  double* to = nullptr;                   ///< Values.
};

/// The positions of the nodes of a set's cells relative to the first node of each.
struct ShapeArguments {
  std::int32_t batches = 0;
  std::int32_t places = 0;                   ///< Nodes of a cell.
  const std::int32_t* locals = nullptr;      ///< By place: the local number of the node; null: the same.
  const std::int32_t* cell_nodes = nullptr;  ///< CellArguments::cell_nodes.
  const double* positions = nullptr;         ///< d per node.
  double* to = nullptr;                      ///< Values.
};

/// A matrix of the reference cell times the values of all cells of a set, along one axis: the places of a cell are
/// outer × column × inner before, and outer × row × inner after. A matrix that is no product over axes has outer and
/// inner 1.
struct CellMatrixArguments {
  std::int32_t batches = 0;
  std::int32_t rows = 0, columns = 0;
  std::int32_t outer = 1, inner = 1;
  std::int32_t by_lane = 0;        ///< Not 0: the result is batches × place × lane × d.
  const double* matrix = nullptr;  ///< Row-major.
  const double* from = nullptr;    ///< Values.
  double* to = nullptr;            ///< Values.
};

/// The slopes of q = Σ_s w_s 1/|Ê| ∫_Ê |∇χ_s J⁻¹|² of each cell by its modes (part_products.h).
struct SlopesArguments {
  std::int32_t batches = 0;
  std::int32_t places = 0;                ///< Of a cell, before and after.
  const std::int32_t* modes = nullptr;    ///< By place: its mode, or −1; null: the same.
  const std::int32_t* first = nullptr;    ///< PartProducts::first.
  const std::int32_t* columns = nullptr;  ///< PartProducts::columns, as places.
  const double* entries = nullptr;        ///< PartProducts::entries.
  const double* weights = nullptr;        ///< By mode: w_s.
  const double* metrics = nullptr;        ///< batches × pair × lane: J⁻¹J⁻ᵀ. Those past the last cell are 0.
  double factor = 1;                      ///< The result is half the slopes times this.
  const double* from = nullptr;           ///< Values at the modes.
  double* to = nullptr;                   ///< Values. Places without a mode become 0.
  double* parts = nullptr;                ///< By block of threads: its part of Σ q over the cells.
};

/// The free nodes of the maps of one order: sums over the cells of each, and its level of the preconditioner.
struct OrderArguments {
  std::int32_t nodes = 0;
  const std::int64_t* begin = nullptr;    ///< nodes + 1: the places of each node, in ascending order.
  const std::int64_t* places = nullptr;   ///< Where the contribution of a place is, in units of d numbers.
  const double* contributions = nullptr;  ///< All sets; null in correct(): there is no level below.
  const double* inverse = nullptr;        ///< By node: of the diagonal.
  double* residual = nullptr;             ///< d per node.
  double* solution = nullptr;             ///< d per node.
  double* parts = nullptr;                ///< By block of threads: its part of residual · solution.
};

/// Vectors over the free nodes, d numbers each. A kernel reads and writes some of them.
struct LossArguments {
  std::int64_t count = 0;  ///< Numbers, or nodes if the kernel works on nodes.
  double factor = 0;
  double* gradient = nullptr;
  double* start = nullptr;
  double* step = nullptr;
  double* residual = nullptr;
  double* direction = nullptr;
  double* product = nullptr;
  double* positions = nullptr;          ///< Of all nodes.
  const std::int32_t* free = nullptr;   ///< Free nodes among all nodes.
  const float* inverse_size = nullptr;  ///< By free node: Problem::inverse_size.
  const double* hold = nullptr;         ///< By free node: what it is held with.
  const double* held_at = nullptr;      ///< d per free node: where it is held.
  float* rough_direction = nullptr;     ///< Of products with the energy's Hessian.
  const float* rough_product = nullptr;
  OrderArguments own;       ///< The maps of the problem's own order, and their contributions.
  double* parts = nullptr;  ///< By block of threads: its part of a sum or its largest value.
};

}  // namespace varimesh::device
