// The energy of the cells of a problem on a device: energies, gradient, linearisation and products.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "core/device/device.h"
#include "core/device_kernels/arguments.h"
#include "core/energy/material.h"
#include "core/kernels/kernels.h"
#include "core/problem/problem.h"

namespace varimesh::device {

/// What CellEnergy does, with the same meaning and nearly the same numbers, from memory on the device: the sum over the
/// cells of slope times energy, where the slopes are CellSet::energy_slope. Gradients are in double precision (48 bits
/// of each cell's contribution), products in single precision, of a Hessian at deformation gradients in 16 bits.
///
/// The problem and the device must outlive the object. The results depend neither on the device nor on its threads.
class CellsOnDevice {
 public:
  /// Copies the problem to the device, with its positions. There are kernels for meshes of tetrahedra of orders 2 to 5
  /// whose targets are constant in each cell.
  static Possible<std::unique_ptr<CellsOnDevice>> make(Device& device, const Problem& problem,
                                                       const Material& material);

  /// Copies Problem::positions again.
  Possible<void> place();
  /// Copies CellSet::delta_squared and CellSet::energy_slope again.
  Possible<void> weigh();

  /// The scans of all cells, by number.
  Possible<std::vector<CellScan>> scan();
  /// The gradient, d numbers per free node.
  Possible<void> gradient(std::span<double> gradient);
  /// The same, bit for bit, and keeps what products need.
  Possible<void> linearise(std::span<double> gradient);
  /// product = Hessian times direction; returns direction · product. Both have d floats per free node.
  Possible<double> multiply(std::span<const float> direction, std::span<float> product);

  /// Bytes on the device.
  std::size_t memory() const;

  /// What linearise() has kept, and the contributions of the last kernel, as BatchSet has them; for tests.
  const Buffer& linearisation() const { return linearisation_; }
  const Buffer& deformation() const { return deformation_; }
  const Buffer& mean() const { return mean_; }
  const Buffer& contributions() const { return contributions_; }

 private:
  CellsOnDevice(Device& device, const Problem& problem, const Material& material)
      : device_(device), problem_(problem), set_(problem.sets.front()), material_(material) {}

  Possible<void> load(const KernelImage& image);
  Possible<void> copy_tables();
  Possible<void> copy_cells();
  Possible<void> copy_nodes();
  Possible<void> make_results();
  CellArguments cell_arguments(const Buffer& derivatives) const;
  Possible<void> run_gradient(const Kernel& kernel, std::span<double> gradient);
  template <class T>
  Possible<void> keep(Buffer& buffer, const std::vector<T>& numbers);

  Device& device_;
  const Problem& problem_;
  const CellSet& set_;
  const Material material_;
  int entries_ = 0;  ///< KeptPartials::kEntries.
  std::unique_ptr<Module> module_;
  Kernel energy_, gradient_, linearise_, product_, add_up_products_, add_up_gradients_;

  Buffer energy_table_, gradient_table_, product_table_, weights_;
  Buffer nodes_, ranks_, inverse_target_, left_factor_, measure_, delta_squared_, slope_, positions_;
  Buffer offsets_, places_, direction_, product_vector_, gradient_vector_, along_;
  Buffer scans_, contributions_, linearisation_, deformation_, mean_;
};

}  // namespace varimesh::device
