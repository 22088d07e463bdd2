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

  // === From memory of this machine, and back to it ===
  /// The scans of all cells, by number.
  Possible<std::vector<CellScan>> scan();
  /// The gradient, d numbers per free node.
  Possible<void> gradient(std::span<double> gradient);
  /// The same, bit for bit, and keeps what products need.
  Possible<void> linearise(std::span<double> gradient);
  /// product = Hessian times direction, after linearise(); returns direction · product. Both have d floats per free
  /// node.
  Possible<double> multiply(std::span<const float> direction, std::span<float> product);

  // === On the device: nothing is copied ===
  /// gradient_there() ← the gradient times `scale`. With `keeps` it is linearise().
  Possible<void> run_gradient(bool keeps, double scale = 1);
  /// product_there() ← Hessian times direction_there(). Leaves direction · product in parts: one for each kBlock nodes.
  Possible<void> run_product();
  /// After a gradient that keeps: the contributions become the nodes' own blocks of the cells' Hessians, lower
  /// triangles by rows.
  Possible<void> run_node_blocks();
  /// After a gradient that keeps: SetOnDevice::tensors() become the cells' mean tensors.
  Possible<void> run_mean_tensors();
  /// After a gradient that keeps, at the same positions: products become those of CellEnergy::keep_convex_part().
  Possible<void> run_convex_part();

  Buffer& positions_there() { return positions_; }
  /// d per free node, then d zeros for the fixed ones.
  Buffer& direction_there() { return direction_; }
  Buffer& product_there() { return product_; }
  Buffer& gradient_there() { return gradient_; }
  /// Where run_product() leaves its parts; null: in memory of its own.
  void leave_parts_in(double* parts) { parts_ = parts; }
  /// What sums over the cells of each node are made of.
  SumArguments sum_arguments() const;
  SharedArrays shared() const;

  /// Bytes on the device.
  std::size_t memory() const;

  /// The sets, and the contributions of all sets to the last sum.
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

  Device& device_;
  const Problem& problem_;
  const Material material_;
  std::vector<std::int32_t> rank_of_;  ///< By node: its rank, or Problem::free.size() if it is fixed.
  std::map<std::string, std::unique_ptr<Module>> modules_;
  std::vector<std::unique_ptr<SetOnDevice>> sets_;
  Kernel add_up_products_, add_up_gradients_;
  Buffer positions_, contributions_, offsets_, places_, direction_, product_, gradient_, along_;
  double* parts_ = nullptr;
};

}  // namespace varimesh::device
