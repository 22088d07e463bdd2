// What a mesh file can tell a viewer about its cells: numbers to colour them by, and a group of those to look at.
#pragma once

#include <span>
#include <vector>

#include "core/diagnosis/diagnosis.h"
#include "core/formats/formats.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Cell arrays for formats that hold fields:
///   scaled_jacobian, distortion_jacobian  as in CellQuality
///   certified     1 valid, −1 invalid, 0 undecided
///   unrepairable  number of the group that the cell is in, from 1 in the order given; 0 where it is in none
class CellMarks {
 public:
  /// `threads` 0 means all. The mesh must have passed check().
  CellMarks(const HighOrderMesh& mesh, std::span<const UnrepairableGroup> groups, int threads);

  /// Views of the arrays; they live as long as this object.
  std::vector<formats::CellField> fields() const;

 private:
  std::vector<double> scaled_jacobian_, distortion_jacobian_, certified_, unrepairable_;
};

/// Puts the groups' cells into one more physical group, named "unrepairable", so that formats without fields show them:
/// each block of cells is cut into those in no group and, behind them on an elementary entity of their own, those in
/// one. Numbers of elements and nodes, other groups and coordinates stay.
void mark_unrepairable(HighOrderMesh& mesh, std::span<const UnrepairableGroup> groups);

}  // namespace varimesh
