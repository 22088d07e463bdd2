// Which cells have kernels that keep them in registers, and into how many parts each kernel splits a cell.
//
// The nodes of a cell stand in columns. A simplex has one node in each. A quadrilateral, a hexahedron or a prism is a
// line, a quadrilateral or a triangle times a line: each node of the base has a column above it. Derivatives are then
// taken in two steps, along the columns and in the base: on a hexahedron of order 4 with less than a quarter of the
// multiplications.
//
// The columns are split among the threads of a cell. A thread has 255 registers, and keeps in them what belongs to its
// columns. More parts need fewer registers and more exchange.
#pragma once

namespace varimesh::device {

/// A shape and an order, as the kernels see them.
struct CellKind {
  int dimension = 0;
  int columns = 0;
  int layers = 1;  ///< Nodes of a column.

  constexpr int nodes() const { return columns * layers; }
  constexpr bool is_layered() const { return layers > 1; }
};

/// Tells kinds from each other.
constexpr int number_of(CellKind kind) { return (kind.dimension * 10 + kind.layers) * 100 + kind.columns; }

/// The kinds of cells that have kernels of their own, as kinds::tetrahedra_4.
namespace kinds {
#define KIND(shape, name, order, dimension, columns, layers) \
  inline constexpr CellKind name##_##order{dimension, columns, layers};
#include "core/device_kernels/kernels/cell_kinds.h"
}  // namespace kinds

enum class CellKernel { Energy, Gradient, Product };

/// The most parts: a batch has sixteen cells, and a warp of threads two of them.
inline constexpr int kMostParts = 16;

/// How many points the threads of a cell work on at once: as many as the cell has parts, but at most four.
constexpr int turns_of(int parts) { return parts < 4 ? parts : 4; }

constexpr int columns_of_part(CellKind kind, int parts) { return (kind.columns + parts - 1) / parts; }

/// Registers of 32 bits that a part needs for its columns from one point to the next. Columns of one node: the node's
/// vector and its sum. Others: value and slope at one height, their sums, and the sums of the nodes.
constexpr int registers_of(CellKernel kernel, CellKind kind, int parts) {
  const int ups = kind.is_layered() ? 2 : 1, downs = kind.is_layered() ? 2 + kind.layers : 1;
  const int vectors = kernel == CellKernel::Energy ? ups : ups + downs;
  return vectors * columns_of_part(kind, parts) * kind.dimension * (kernel == CellKernel::Product ? 1 : 2);
}

/// Into how many parts a kernel splits a cell: a power of two. A part of a tetrahedron has at most the number of nodes
/// that was fastest at order 4 on a card. All other cells have the fewest parts whose columns leave enough registers
/// for the work at a point, so that NVIDIA's assembler keeps no number in memory.
constexpr int parts_of(CellKernel kernel, CellKind kind) {
  const bool is_tetrahedron = kind.dimension == 3 && !kind.is_layered();
  const int most_columns = !is_tetrahedron                  ? kind.columns
                           : kernel == CellKernel::Energy   ? 18
                           : kernel == CellKernel::Gradient ? 9
                                                            : 10;
  const int most_registers = kernel == CellKernel::Product ? 85 : 125;
  int parts = is_tetrahedron && kernel == CellKernel::Gradient ? 2 : 1;
  while (parts < kMostParts &&
         (columns_of_part(kind, parts) > most_columns || registers_of(kernel, kind, parts) > most_registers))
    parts *= 2;
  return parts;
}

/// The points, rounded up to whole turns.
constexpr int padded_points(int points, int parts) {
  return (points + turns_of(parts) - 1) / turns_of(parts) * turns_of(parts);
}

}  // namespace varimesh::device
