// The energy of a whole mesh and its free nodes, for Newton's method, on a device.
#pragma once

#include <optional>
#include <span>

#include "core/device_kernels/kernels/solver_arguments.h"
#include "core/energy/material.h"
#include "core/preconditioner/on_device/preconditioner_on_device.h"
#include "core/solvers/on_device/minimised_on_device.h"
#include "core/terms/cell_energy.h"

namespace varimesh {

/// Like MeshObjective, but the vectors are on a device, and so is everything that is done to them. Only the numbers of
/// the cells' energies come back in a step, the positions at its end, and the cells' mean tensors when the
/// preconditioner is made anew: multigrid and the factors of stretched cells are set up on the processor. All devices
/// compute the same bits, in every run.
class DeviceObjective final : public MinimisedOnDevice<device::VectorArguments> {
 public:
  /// Throws DeviceFailed. All arguments are kept by reference, except for the material and the norm.
  DeviceObjective(device::Device& device, Problem& problem, const Kernels& kernels, const HessianKernels& hessian,
                  const Material& material, const PNorm& norm, const Team& team);

  /// Reports assemblies and products to `meter`, which may be null and must outlive the object.
  void count_with(WorkMeter* meter) { meter_ = meter; }

  double linearise(bool renews) override;
  double precondition() override;
  double multiply() override;
  double preconditioned_norm(double rq) const override;
  double largest_step() override { return largest_of_nodes(vectors_.size_of_step) * step_scale_; }
  double largest_correction() override { return largest_of_nodes(vectors_.size_of_product) * correction_scale_; }
  double largest_defect() override;
  double finish_step() override;
  double noise() override { return energy_.noise(); }
  double move(double alpha) override;

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
  device::VectorArguments arguments(std::int64_t count) const override;
  void scale_residual();

  WorkMeter* meter_ = nullptr;
  CellEnergy energy_;  ///< For its scale, its sum and the tables of its batches.
  std::optional<PreconditionerOnDevice> preconditioner_;
  device::Kernel clear_step_, scale_residual_, add_residual_, size_of_gradient_;
  double gradient_scale_ = 1;                     ///< The residual is divided by this.
  double step_scale_ = 1, correction_scale_ = 1;  ///< The step and M⁻¹ r times these are displacements.
  device::Buffer residual_;
};

}  // namespace varimesh
