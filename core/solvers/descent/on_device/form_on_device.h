// The loss of accuracy as a quadratic form, on a device.
#pragma once

#include <vector>

#include "core/device_kernels/cells_on_device.h"
#include "core/device_kernels/joiner.h"
#include "core/solvers/descent/form/modal_form.h"
#include "core/solvers/descent/on_device/cell_values.h"
#include "core/solvers/descent/on_device/space_on_device.h"

namespace varimesh {

/// What ModalForm does with vectors, from memory on the device. ModalForm takes the frames on the processor.
class FormOnDevice {
 public:
  /// @param descent  the module of device::descent_kernels()
  /// @param space    the maps of the problem's own order
  /// All other arguments are kept by reference and must outlive the object. `values` may be used by others between two
  /// calls, and so may the contributions of `cells`, once they have been added up.
  FormOnDevice(device::Queue& queue, const device::Module* descent, device::CellsOnDevice& cells,
               const Problem& problem, const ModalForm& form, const SpaceOnDevice& space, CellValues& values,
               device::Joiner& joiner);

  /// Copies the frames of the form.
  void take_frames();

  /// Q at the positions of `cells`. Its gradient is the sum of the contributions over the places of each node.
  double gradient();
  /// The contributions of the second derivative times a direction, d numbers per free node.
  void multiply(const double* direction);

  std::size_t memory() const;

 private:
  struct Set {
    MatrixOnDevice to_modes, to_nodes;
    std::int32_t places = 0;  ///< Of modes.
    device::Buffer locals;    ///< ShapeArguments::locals; empty: the nodes are in their own order.
    device::Buffer modes;     ///< SlopesArguments; empty: so are the modes.
    device::Buffer first, columns, entries, weights, metrics;
  };
  void copy_set(std::size_t number);
  /// From the values at the nodes of a set to its contributions. Returns Σ q over its cells if `wants_value`.
  double differentiate(std::size_t number, bool wants_value);
  /// The first contribution of a set.
  double* contributions_of(std::size_t number) const;

  device::Queue& queue_;
  device::CellsOnDevice& cells_;
  const Problem& problem_;
  const ModalForm& form_;
  const SpaceOnDevice& space_;
  CellValues& values_;
  device::Joiner& joiner_;
  device::Kernel gather_values_, gather_shape_, slopes_, slopes_and_value_;
  std::vector<Set> sets_;
};

}  // namespace varimesh
