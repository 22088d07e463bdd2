// What a mesh file tells a viewer about its cells: values by which to colour them, and a group of unrepairable cells.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/diagnosis/diagnosis.h"
#include "core/formats/formats.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Cell arrays for formats that contain fields:
///   scaled_jacobian, distortion_jacobian  as in CellQuality
///   certified     1: valid, −1: invalid, 0: undecided
///   unrepairable  the number of the cell's group, from 1 in the given order; 0 if it is in no group
///   accuracy_loss  CellAccuracy::loss; left out if the mesh is a surface in space that does not lie in one plane
///   layer_thickness_share  only if a row was grown on walls: thickness_field()
class CellMarks {
 public:
  /// The mesh must have passed check_structure(), or check_judgeable() if it is a surface in space.
  /// @param threads how many threads to use; 0: all of the machine's
  /// @param thickness  as for thickness_field(); empty: no row was grown. It must live as long as this object.
  CellMarks(const HighOrderMesh& mesh, std::span<const UnrepairableGroup> groups, int threads,
            std::span<const double> thickness = {});

  /// Views of the arrays. They are valid as long as this object.
  std::vector<formats::CellField> fields() const;
  std::span<const double> scaled_jacobian() const { return scaled_jacobian_; }
  std::span<const double> certified() const { return certified_; }

 private:
  std::vector<double> scaled_jacobian_, distortion_jacobian_, certified_, unrepairable_, accuracy_loss_;
  std::span<const double> thickness_;
};

/// The thickness of a row that was grown on walls, over what was asked for, in each cell that is a part of it, and 0 in
/// others (thickness_of_cells() of core/layers/thickness_shares.h). It is the only mark that MSH files have as a field.
formats::CellField thickness_field(std::span<const double> thickness);

/// Adds the cells of all groups to a new physical group named "unrepairable", for formats without fields. If a block
/// contains such cells, they are moved to a new block behind it, on an elementary entity of its own. Numbers of
/// elements and nodes, other groups and coordinates stay the same.
/// @return by cell of the marked mesh: which cell of the given mesh it was
std::vector<std::int32_t> mark_unrepairable(HighOrderMesh& mesh, std::span<const UnrepairableGroup> groups);

}  // namespace varimesh
