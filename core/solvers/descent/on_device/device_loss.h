// The loss of accuracy of a mesh with the energy as its barrier, for Newton's method, on a device.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "core/device/queue.h"
#include "core/device_kernels/cells_on_device.h"
#include "core/device_kernels/joiner.h"
#include "core/energy/material.h"
#include "core/solvers/descent/form/modal_form.h"
#include "core/solvers/descent/form/order_levels.h"
#include "core/solvers/descent/on_device/cell_values.h"
#include "core/solvers/descent/on_device/form_on_device.h"
#include "core/solvers/descent/on_device/levels_on_device.h"
#include "core/solvers/device_failed.h"
#include "core/solvers/minimised.h"
#include "core/terms/cell_energy.h"

namespace varimesh {

/// What LossObjective is, with its vectors and everything that is done to them on a device. In a step, the scans of the
/// cells come back for each trial of the line search, and the positions at its end. Frames, diagonals and what holds
/// vertices are taken on the processor and copied when a round begins. The same device computes the same bits in every
/// run; all devices do.
///
/// After a fault of the device its functions throw DeviceFailed.
class DeviceLoss final : public Minimised {
 public:
  /// Throws DeviceFailed. All arguments are kept by reference but `material`, the energy's, and must outlive the
  /// object. `energy` gets the scans; its own derivatives are not used.
  DeviceLoss(device::Device& device, Problem& problem, CellEnergy& energy, const ModalForm& form,
             const OrderLevels& levels, const Material& material, const Team& team);

  /// Call it before the first linearise(), and whenever the form has other frames, the levels have other diagonals or
  /// vertices are held in another way: LossObjective::hold() and `places`, d numbers per free node.
  void begin_round(std::span<const double> hold, std::span<const double> places);

  double linearise(bool renews) override;
  bool make_convex() override;
  double precondition() override;
  double multiply() override;
  void advance(double alpha) override { run(kernels_.advance, alpha); }
  void turn(double beta) override { run(kernels_.turn, beta); }
  void take_direction() override { run(kernels_.take_direction); }
  double gradient_norm() override;
  double preconditioned_norm(double rq) const override;
  double largest_step() override { return largest(kernels_.size_of_step); }
  double largest_correction() override { return largest(kernels_.size_of_product); }
  double largest_defect() override;
  double finish_step() override;
  double noise() override { return noise_; }
  double move(double alpha) override;
  void settle() override;
  void go_back() override { has_form_ = false; }

  /// Bytes on the device.
  std::size_t memory() const;

 private:
  /// Kernels on vectors.
  struct VectorKernels {
    device::Kernel add_up_form, add_form, held, begin_system, round_direction, add_up_product, advance, turn,
        take_direction, keep_residual, subtract_kept, square_of_gradient, along_step, size_of_step, size_of_product,
        keep_start, place;
  };
  void find_kernels();
  /// Throws DeviceFailed if there was a fault.
  void check() const;
  device::LossArguments arguments(std::int64_t count) const;
  /// Runs a kernel on every unknown, or on every free node.
  void run(const device::Kernel& kernel, double factor = 0);
  void run_on_nodes(const device::Kernel& kernel, double factor = 0);
  /// Runs one that leaves the parts of a sum, on `count` unknowns or nodes.
  double sum(const device::Kernel& kernel, std::int64_t count, double factor = 0);
  /// Runs one that leaves squares of sizes by node; returns the largest size.
  double largest(const device::Kernel& kernel);
  /// Scans all cells where the nodes are on the device.
  void scan();
  /// The form at the positions on the device. Leaves its gradient in the product.
  double form();

  device::Queue queue_;
  Problem& problem_;
  CellEnergy& energy_;
  const Team& team_;
  const bool has_convex_part_;
  const std::int64_t nodes_, unknowns_;
  bool has_form_ = false;  ///< The product has the form's gradient where the nodes are, and form_value_ is its value.
  bool is_convex_ = false;
  double form_value_ = 0, noise_ = 0;
  std::unique_ptr<device::Module> descent_;
  std::unique_ptr<device::CellsOnDevice> cells_;
  std::optional<device::Joiner> joiner_;
  std::optional<CellValues> values_;
  std::optional<LevelsOnDevice> levels_;
  std::optional<FormOnDevice> form_;
  VectorKernels kernels_;
  device::Buffer start_, step_, residual_, direction_, product_, free_, inverse_size_, hold_, held_at_;
};

}  // namespace varimesh
