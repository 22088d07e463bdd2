// The preconditioner of Newton's method on a device.
#pragma once

#include "core/preconditioner/on_device/coarse_on_device.h"
#include "core/preconditioner/on_device/groups_on_device.h"

namespace varimesh {

/// What Preconditioner does, from memory on the device, with nearly the same numbers: the nodes' blocks, the coarse
/// level and the groups of stretched cells. What is set up once for a mesh, multigrid and the factors of the groups are
/// made on the processor and copied.
class PreconditionerOnDevice {
 public:
  /// @param batches  of the problem; only their tables of nodes are used
  /// All arguments are kept by reference and must outlive the object.
  PreconditionerOnDevice(device::Queue& queue, const device::Module* solver, device::CellsOnDevice& cells,
                         const Problem& problem, std::vector<BatchSet>& batches, device::Joiner& joiner,
                         const Team& team);

  /// The blocks of the nodes, from what the cells have linearised.
  void make_blocks();
  /// The coarse level and the groups, from the same.
  void assemble();

  /// Reads or writes what the coarse level and the groups are made from, if they will be used again (`is_used`): as
  /// Preconditioner::state().
  template <class Archive>
  void state(Archive& archive, bool is_used) {
    level_.tensors_state(archive, is_used);
    if constexpr (Archive::kReads)
      if (is_used && !archive.failed()) {
        coarse_.assemble_from_level();
        copy_groups();
      }
  }

  /// product = M⁻¹ residual, d floats per free node. Returns residual · product.
  double apply(const float* residual, float* product);

  std::size_t memory() const;

 private:
  void copy_groups();

  device::Queue& queue_;
  device::CellsOnDevice& cells_;
  const Problem& problem_;
  device::Joiner& joiner_;
  CoarseLevel level_;
  StretchedCells stretched_;
  CoarseOnDevice coarse_;
  GroupsOnDevice groups_;
  device::Kernel invert_block_, share_residual_, precondition_;
  device::Buffer first_cell_, inverse_, shared_;
};

}  // namespace varimesh
