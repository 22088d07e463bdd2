// The energy of the cells of a problem on a device: energies, gradient, linearisation and products.
#pragma once

#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/device/device.h"
#include "core/device_kernels/kernels/arguments.h"
#include "core/device_kernels/set_on_device.h"
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
  /// Copies the problem to the device, with its positions.
  static Possible<std::unique_ptr<CellsOnDevice>> make(Device& device, const Problem& problem,
                                                       const Material& material);

  /// Copies Problem::positions again.
  Possible<void> place();
  /// Copies CellSet::delta_squared and CellSet::energy_slope again.
  ///
  /// @param curvatures  by cell number: φ'' of the p-norm Σ φ(E), whose slopes φ' are CellSet::energy_slope
  ///                    (PNorm::curvature); none: the sum of the energies
  Possible<void> weigh(std::span<const double> curvatures = {});

  /// The scans of all cells, by number.
  Possible<std::vector<CellScan>> scan();
  /// The gradient, d numbers per free node.
  Possible<void> gradient(std::span<double> gradient) { return run_gradient(gradient, false); }
  /// The same, bit for bit, and keeps what products need.
  Possible<void> linearise(std::span<double> gradient) { return run_gradient(gradient, true); }
  /// product = Hessian times direction, after linearise(); returns direction · product. Both have d floats per free
  /// node.
  Possible<double> multiply(std::span<const float> direction, std::span<float> product);

  /// Bytes on the device.
  std::size_t memory() const;

  // For tests: the sets, and the contributions of all sets to the last sum.
  const std::vector<std::unique_ptr<SetOnDevice>>& sets() const { return sets_; }
  const Buffer& contributions() const { return contributions_; }

 private:
  CellsOnDevice(Device& device, const Problem& problem, const Material& material)
      : device_(device), problem_(problem), material_(material) {}

  Possible<void> copy_sets();
  Possible<void> load_sums();
  Possible<void> copy_nodes();
  /// The module of an image, loaded once.
  Possible<const Module*> module_of(const KernelImage& image);
  SharedArrays shared() const;
  SumArguments sum_arguments() const;
  Possible<void> run_gradient(std::span<double> gradient, bool keeps);

  Device& device_;
  const Problem& problem_;
  const Material material_;
  std::vector<std::int32_t> rank_of_;  ///< By node: its rank, or Problem::free.size() if it is fixed.
  std::map<std::string, std::unique_ptr<Module>> modules_;
  std::vector<std::unique_ptr<SetOnDevice>> sets_;
  Kernel add_up_products_, add_up_gradients_;
  Buffer positions_, contributions_, offsets_, places_, direction_, product_, gradient_, along_;
};

}  // namespace varimesh::device
