// The loss of accuracy of a mesh with the energy as its barrier, for Newton's method, on a device.
#pragma once

#include <optional>
#include <span>

#include "core/device_kernels/kernels/descent/arguments.h"
#include "core/energy/material.h"
#include "core/solvers/descent/form/modal_form.h"
#include "core/solvers/descent/form/order_levels.h"
#include "core/solvers/descent/on_device/cell_values.h"
#include "core/solvers/descent/on_device/form_on_device.h"
#include "core/solvers/descent/on_device/levels_on_device.h"
#include "core/solvers/on_device/minimised_on_device.h"
#include "core/terms/cell_energy.h"

namespace varimesh {

/// What LossObjective is, with its vectors and everything that is done to them on a device. In a step, the scans of the
/// cells come back for each trial of the line search, and the positions at its end. Frames, diagonals and what holds
/// vertices are taken on the processor and copied when a round begins. The same device computes the same bits in every
/// run; all devices do.
///
/// After a fault of the device its functions throw DeviceFailed.
class DeviceLoss final : public MinimisedOnDevice<device::LossArguments> {
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
  double preconditioned_norm(double rq) const override;
  double largest_step() override { return largest_of_nodes(vectors_.size_of_step); }
  double largest_correction() override { return largest_of_nodes(vectors_.size_of_product); }
  double largest_defect() override;
  double finish_step() override;
  double noise() override { return noise_; }
  double move(double alpha) override;
  void go_back() override { has_form_ = false; }

  /// Bytes on the device.
  std::size_t memory() const;

 private:
  device::LossArguments arguments(std::int64_t count) const override;
  /// The form at the positions on the device. Leaves its gradient in the product.
  double form();

  CellEnergy& energy_;
  const bool has_convex_part_;
  bool has_form_ = false;  ///< The product has the form's gradient where the nodes are, and form_value_ is its value.
  bool is_convex_ = false;
  double form_value_ = 0, noise_ = 0;
  std::optional<CellValues> values_;
  std::optional<LevelsOnDevice> levels_;
  std::optional<FormOnDevice> form_;
  device::Kernel add_up_form_, add_form_, held_, begin_system_, round_direction_, add_up_product_, subtract_kept_;
  device::Buffer start_, residual_, direction_, product_, hold_, held_at_;
};

}  // namespace varimesh
