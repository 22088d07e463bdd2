// The energy of a whole mesh and its free nodes, for Newton's method, on a device.
#pragma once

#include <memory>
#include <span>

#include "core/device/queue.h"
#include "core/device_kernels/cells_on_device.h"
#include "core/device_kernels/joiner.h"
#include "core/energy/material.h"
#include "core/preconditioner/on_device/preconditioner_on_device.h"
#include "core/solvers/device_failed.h"
#include "core/solvers/minimised.h"
#include "core/terms/cell_energy.h"

namespace varimesh {

/// What MeshObjective is, with its vectors and everything that is done to them on a device. Only the numbers of the
/// cells' energies come back in a step, the positions at its end, and the cells' mean tensors when the preconditioner
/// is made anew: multigrid and the factors of stretched cells are set up on the processor. The same device computes the
/// same bits in every run; all devices do.
class DeviceObjective final : public Minimised {
 public:
  /// Throws DeviceFailed. All arguments are kept by reference, but for the material and the norm.
  DeviceObjective(device::Device& device, Problem& problem, const Kernels& kernels, const HessianKernels& hessian,
                  const Material& material, const PNorm& norm, const Team& team);

  /// Reports assemblies and products to `meter`, which may be null and must outlive the object.
  void count_with(WorkMeter* meter) { meter_ = meter; }

  double linearise(bool renews) override;
  double precondition() override;
  double multiply() override;
  void advance(double alpha) override;
  void turn(double beta) override;
  void take_direction() override;
  double gradient_norm() override;
  double preconditioned_norm(double rq) const override;
  double largest_step() override;
  double largest_correction() override;
  double largest_defect() override;
  double finish_step() override;
  double noise() override;
  double move(double alpha) override;
  void settle() override;

  /// By cell: the scans where the nodes are.
  std::span<const CellScan> scans() const { return energy_.scans(); }

  /// As Preconditioner::state().
  template <class Archive>
  void state(Archive& archive, bool is_used) {
    preconditioner_->state(archive, is_used);
  }

  /// Bytes on the device.
  std::size_t memory() const;

 private:
  /// The kernels of vectors.
  struct VectorKernels {
    device::Kernel advance, turn, take_direction, clear_step, scale_residual, keep_residual, add_residual, keep_start,
        place, along_step, square_of_gradient, size_of_gradient, size_of_step, size_of_product;
  };
  void copy();
  void find_kernels();
  /// Throws DeviceFailed if there was a fault.
  void check() const;
  device::VectorArguments arguments(std::int64_t count) const;
  /// Runs a kernel on every unknown.
  void run(const device::Kernel& kernel, double factor = 0);
  /// Runs one that leaves the parts of a sum.
  double sum(const device::Kernel& kernel, double factor = 0);
  /// Runs one that leaves squares of sizes by node; returns the largest size.
  double largest_of_nodes(const device::Kernel& kernel);
  /// Scans all cells where the nodes are on the device.
  void scan();
  void scale_residual();

  device::Queue queue_;
  Problem& problem_;
  const Team& team_;
  WorkMeter* meter_ = nullptr;
  CellEnergy energy_;  ///< For its scale, its sum and the tables of its batches.
  std::unique_ptr<device::Module> solver_;
  std::unique_ptr<device::CellsOnDevice> cells_;
  std::optional<device::Joiner> joiner_;
  std::optional<PreconditionerOnDevice> preconditioner_;
  VectorKernels kernels_;
  std::int64_t unknowns_;
  double gradient_scale_ = 1;                     ///< The residual is divided by this.
  double step_scale_ = 1, correction_scale_ = 1;  ///< The step and M⁻¹ r times these are displacements.
  device::Buffer step_, residual_, free_, inverse_size_;
};

}  // namespace varimesh
