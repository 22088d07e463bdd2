// What the kernels of Newton's method read and write besides those of the cells: vectors over the free nodes, the
// nodes' blocks, the coarse level of order 2, and the cycle of order 1.
//
// d is the dimension. "Padded" vectors have 2 numbers per node in the plane and 4 in space.
#pragma once

#include <cstdint>

namespace varimesh::device {

/// Threads of a block that leaves parts of a sum.
inline constexpr int kJoinedThreads = 128;
/// Parts of a sum that a thread joins before the threads of a block join theirs.
inline constexpr int kPartsPerThread = 8;
/// Threads that share a row of the coarse matrix.
inline constexpr int kRowParts = 4;

/// Vectors over the free nodes, d numbers each. A kernel reads and writes some of them.
struct VectorArguments {
  std::int64_t count = 0;  ///< Numbers, or nodes if the kernel works on nodes.
  double factor = 0;
  double* step = nullptr;
  float* residual = nullptr;
  float* direction = nullptr;
  float* product = nullptr;
  double* gradient = nullptr;
  double* start = nullptr;              ///< Where the step begins. It may be the memory of the gradient.
  double* positions = nullptr;          ///< Of all nodes.
  const std::int32_t* free = nullptr;   ///< Free nodes among all nodes.
  const float* inverse_size = nullptr;  ///< By free node: Problem::inverse_size.
  double* parts = nullptr;              ///< By block of threads: its part of a sum or its largest value.
};

/// Fewer parts of a sum, or of a largest value, from many.
struct PartsArguments {
  std::int64_t count = 0;
  const double* from = nullptr;
  double* to = nullptr;  ///< By block of threads.
};

/// The d × d blocks of the free nodes and their inverses.
struct BlockArguments {
  std::int32_t nodes = 0;
  const std::int64_t* offsets = nullptr;  ///< As SumArguments.
  const std::int64_t* places = nullptr;
  const float* contributions = nullptr;  ///< Lower triangles by rows, of d (d + 1)/2 numbers.
  float* inverse = nullptr;              ///< By node: the lower triangle of the inverse by rows.
};

/// A cell of a node, as Incidence.
struct CellOfNode {
  std::int32_t cell;
  std::int16_t set, local;
};

/// CoarseSpace::Set.
struct CoarseSet {
  std::int32_t nodes_per_cell = 0;
  const std::int32_t* nodes = nullptr;
  const float* stiffness = nullptr;
  const std::int64_t* value_begin = nullptr;
  const std::int32_t* value_column = nullptr;
  const float* value_factor = nullptr;
  const float* tensors = nullptr;  ///< By cell, as HessianKernels::mean_tensors.
};

/// Restriction of values at the nodes of each cell to its coarse nodes.
struct RestrictArguments {
  std::int32_t batches = 0;
  std::int32_t nodes = 0;   ///< Of a cell.
  std::int32_t coarse = 0;  ///< Coarse nodes of a cell.
  const std::int64_t* begin = nullptr;
  const std::int32_t* column = nullptr;
  const float* factor = nullptr;
  const std::int32_t* ranks = nullptr;
  const float* values = nullptr;   ///< d per free node, then d zeros.
  float* contributions = nullptr;  ///< batches × coarse node × lane × d.
};

/// The coarse level: CoarseLevel and its BlockRows.
struct CoarseArguments {
  std::int32_t nodes = 0;
  std::int32_t first = 0, last = 0;  ///< The rows that a kernel works on.
  std::int64_t blocks = 0;           ///< Of the matrix, without the diagonal.
  const CoarseSet* sets = nullptr;
  const std::int64_t* cell_begin = nullptr;  ///< nodes + 1
  const CellOfNode* cells = nullptr;

  const std::int64_t* begin = nullptr;  ///< nodes + 1
  const std::int32_t* column = nullptr;
  const std::int32_t* row = nullptr;  ///< By block.
  std::int16_t* entry = nullptr;
  float* inverse_factor = nullptr;  ///< d columns of d per node.

  const std::int64_t* places = nullptr;  ///< By cell of a node: where its contribution is.
  const float* contributions = nullptr;
  float* right = nullptr;     ///< Padded.
  float* x = nullptr;         ///< Padded.
  float* residual = nullptr;  ///< Padded.

  // The level of order 1 below.
  std::int32_t vertices = 0;
  const std::int64_t* above_begin = nullptr;  ///< Values at the coarse nodes from those at the vertices.
  const std::int32_t* above_column = nullptr;
  const float* above_factor = nullptr;
  const std::int64_t* below_begin = nullptr;  ///< The transpose.
  const std::int32_t* below_column = nullptr;
  const float* below_factor = nullptr;
  double* linear_right = nullptr;  ///< vertices × d
  const double* linear_solution = nullptr;
};

/// The end of the preconditioner at the free nodes.
struct NodeArguments {
  std::int32_t nodes = 0;
  const std::int64_t* offsets = nullptr;
  const CellOfNode* first_cell = nullptr;  ///< By node.
  const CoarseSet* sets = nullptr;
  const float* coarse = nullptr;   ///< Padded; null: there is no coarse level.
  const float* inverse = nullptr;  ///< BlockArguments::inverse.
  const float* residual = nullptr;
  float* product = nullptr;
  float* shared = nullptr;  ///< d per node: the residual over the number of its cells.
  double* parts = nullptr;
};

/// A level of multigrid: LevelMatrix, and one step of its smoother. Vectors are rows × d.
struct LevelArguments {
  std::int32_t rows = 0;
  const std::int64_t* begin = nullptr;
  const std::int32_t* column = nullptr;
  const float* value = nullptr;
  const double* diagonal = nullptr;
  const double* inverse = nullptr;
  const double* right = nullptr;
  const double* now = nullptr;
  double* next = nullptr;  ///< Before: the iterate before `now`. After: the iterate after it, or the residual.
  double momentum = 0, step = 0;
  std::int32_t is_zero = 0;   ///< `now` is 0, whatever it holds.
  std::int32_t was_zero = 0;  ///< The iterate before is.
};

/// to = rows · from, or to += rows · from. Vectors have d numbers per row.
struct RowsArguments {
  std::int32_t rows = 0;
  std::int32_t adds = 0;
  const std::int64_t* begin = nullptr;
  const std::int32_t* column = nullptr;
  const float* value = nullptr;
  const double* from = nullptr;
  double* to = nullptr;
};

/// to = matrix · from with a dense matrix.
struct DenseArguments {
  std::int32_t rows = 0;
  const double* matrix = nullptr;  ///< rows × rows
  const double* from = nullptr;
  double* to = nullptr;
};

/// Groups of stretched cells, one row after another: StretchedCells::Group.
struct GroupArguments {
  std::int32_t rows = 0;
  const std::int32_t* first = nullptr;   ///< By row: the first row of its group.
  const std::int32_t* end = nullptr;     ///< By row: the row after the last of its group.
  const std::int64_t* factor = nullptr;  ///< By row: where the triangle of its group begins.
  const float* triangles = nullptr;
  const std::int32_t* unknown = nullptr;  ///< By row: its place in r and z.
  const float* weight = nullptr;          ///< By row.
  const float* residual = nullptr;
  float* value = nullptr;    ///< By row: L⁻¹ W r.
  float* product = nullptr;  ///< By row: W L⁻ᵀ of that.
  double* parts = nullptr;
  // Sums over the groups of each unknown.
  std::int32_t unknowns = 0;
  const std::int32_t* own = nullptr;    ///< The unknowns.
  const std::int32_t* begin = nullptr;  ///< unknowns + 1
  const std::int32_t* rows_of = nullptr;
  float* z = nullptr;
};

}  // namespace varimesh::device
