// What all objectives have in common whose vectors are on a device.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <memory>
#include <optional>
#include <utility>

#include "core/base/team.h"
#include "core/device/queue.h"
#include "core/device_kernels/cells_on_device.h"
#include "core/device_kernels/joiner.h"
#include "core/device_kernels/kernels/descent/arguments.h"
#include "core/device_kernels/kernels/solver_arguments.h"
#include "core/energy/material.h"
#include "core/problem/problem.h"
#include "core/solvers/device_failed.h"
#include "core/solvers/minimised.h"
#include "core/terms/cell_energy.h"

namespace varimesh {

/// The cells of a problem on a device, the kernels of an objective's module, and all that is done to vectors alike in
/// single and in double precision. After a fault of the device, its functions throw DeviceFailed.
///
/// @tparam Arguments  of the kernels on vectors: device::VectorArguments or device::LossArguments
template <class Arguments>
class MinimisedOnDevice : public Minimised {
 public:
  void advance(double alpha) override { run(vectors_.advance, alpha); }
  void turn(double beta) override { run(vectors_.turn, beta); }
  void take_direction() override { run(vectors_.take_direction); }
  double gradient_norm() override;
  /// Copies the positions on the device to the problem.
  void settle() override;

 protected:
  /// Throws DeviceFailed. `problem` and `team` are kept by reference.
  MinimisedOnDevice(device::Device& device, Problem& problem, const device::KernelImage& image,
                    const Material& material, const Team& team);

  /// The vectors, for a kernel that runs on `count` unknowns or nodes.
  virtual Arguments arguments(std::int64_t count) const = 0;
  /// What all arguments have: numbers of the cells, step, free nodes and their sizes.
  Arguments common(std::int64_t count) const;

  /// Finds kernels of the module by name.
  void find(std::initializer_list<std::pair<const char*, device::Kernel*>> kernels);
  /// Throws DeviceFailed if there was a fault.
  void check() const;
  /// Runs a kernel on every unknown, or on every free node.
  void run(const device::Kernel& kernel, double factor = 0);
  void run_on_nodes(const device::Kernel& kernel, double factor = 0);
  /// Runs one that leaves the parts of a sum, or of a largest value, on `count` unknowns or nodes.
  double sum(const device::Kernel& kernel, std::int64_t count, double factor = 0);
  double largest(const device::Kernel& kernel, std::int64_t count);
  /// Runs one that leaves squares of sizes by node; returns the largest size.
  double largest_of_nodes(const device::Kernel& kernel);
  /// Scans all cells where the nodes are on the device.
  void scan(CellEnergy& energy);
  /// Bytes on the device.
  std::size_t memory_in_common() const;

  /// The kernels on vectors that every module has.
  struct VectorKernels {
    device::Kernel advance, turn, take_direction, keep_residual, square_of_gradient, along_step, size_of_step,
        size_of_product, keep_start, place;
  };

  device::Queue queue_;
  Problem& problem_;
  const Team& team_;
  const std::int64_t nodes_, unknowns_;  ///< Free nodes, and d times as many.
  std::unique_ptr<device::Module> module_;
  std::unique_ptr<device::CellsOnDevice> cells_;
  std::optional<device::Joiner> joiner_;
  VectorKernels vectors_;
  device::Buffer step_, free_, inverse_size_;
};

extern template class MinimisedOnDevice<device::VectorArguments>;
extern template class MinimisedOnDevice<device::LossArguments>;

}  // namespace varimesh
