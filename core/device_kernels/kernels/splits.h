// Into how many parts each kernel splits a cell.
//
// A thread has 255 registers, and keeps in them what belongs to its nodes: 2 d for each node of the energy (positions
// in double precision), 4 d for each of the gradient (positions and sums), 2 d for each of the product (both in single
// precision). More parts need fewer registers and more exchange.
#pragma once

namespace varimesh::device {

enum class CellKernel { Energy, Gradient, Product };

constexpr int parts_for(int nodes, int most_per_part, int least_parts) {
  int parts = least_parts;
  while ((nodes + parts - 1) / parts > most_per_part) parts *= 2;
  return parts;
}

/// A power of two up to 8.
constexpr int parts_of(CellKernel kernel, int nodes) {
  if (kernel == CellKernel::Gradient) return parts_for(nodes, 10, 2);
  return parts_for(nodes, kernel == CellKernel::Energy ? 18 : 10, 1);
}

/// Points that are worked on at once, one by each part. Parts past them repeat what others do.
constexpr int turns_of(int parts) { return parts < 4 ? parts : 4; }

/// Points of a table: those of the rule, and as many more as a turn needs.
constexpr int padded_points(int points, int parts) {
  return (points + turns_of(parts) - 1) / turns_of(parts) * turns_of(parts);
}

}  // namespace varimesh::device
