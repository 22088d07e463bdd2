// One set of cells on a device: its arrays, and the launches of its kernels. There are two kinds (split_cells.h,
// general_cells.h).
#pragma once

#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "core/device/device.h"
#include "core/device/queue.h"
#include "core/device_kernels/kernels/arguments.h"
#include "core/energy/material.h"
#include "core/kernels/hessian/batch.h"
#include "core/kernels/kernels.h"
#include "core/problem/problem.h"

namespace varimesh::device {

/// Fills a buffer, and makes it first if it has another size.
template <class T>
Possible<void> keep(Device& device, Buffer& buffer, const std::vector<T>& numbers) {
  if (!numbers.empty() && buffer.bytes() == numbers.size() * sizeof(T))
    return buffer.upload(std::span<const T>(numbers));
  auto made = device.allocate_with(std::span<const T>(numbers));
  if (!made) return tl::unexpected(made.error());
  buffer = std::move(*made);
  return {};
}

/// Arrays that the sets of a problem share.
struct SharedArrays {
  const double* positions = nullptr;
  const float* direction = nullptr;
  float* contributions = nullptr;  ///< Of all sets.
};

/// A set of a problem, and where its numbers are among the numbers of all sets. All of it outlives the set on the
/// device.
struct SetPlace {
  const CellSet& cells;
  const Material& material;
  std::size_t first;                         ///< How many contributions the sets before it have.
  const std::vector<std::int32_t>& rank_of;  ///< By node: its rank, or Problem::free.size() if it is fixed.
  std::vector<int> slots;                    ///< The quadrature point of each slot (FoldedGradient::points).
};

class SetOnDevice {
 public:
  SetOnDevice(Device& device, const SetPlace& place)
      : device_(device),
        set_(place.cells),
        material_(place.material),
        first_(place.first),
        rank_of_(place.rank_of),
        slots_(place.slots) {}
  virtual ~SetOnDevice() = default;

  /// Copies the set to the device.
  /// @param kernels  those of its cells
  /// @param general  those of cells of any shape; may be the same
  virtual Possible<void> copy(const Module& kernels, const Module& general) = 0;
  /// Copies CellSet::delta_squared and CellSet::energy_slope again, and the curvatures φ'' of the cells; none: no
  /// p-norm.
  Possible<void> weigh(std::span<const double> curvatures);

  // Launches kernels.
  virtual Possible<void> scan(const SharedArrays& shared) = 0;
  virtual Possible<void> gradient(const SharedArrays& shared, bool keeps) = 0;
  virtual Possible<void> product(const SharedArrays& shared) = 0;

  // Launch kernels of the p-norm's term, if there are curvatures: after a gradient that keeps, and after a product.
  Possible<void> keep_cell_gradients(const SharedArrays& shared);
  Possible<void> add_norm_term(const SharedArrays& shared);

  // Launch kernels after a gradient that keeps: the contributions become the nodes' own blocks, and tensors() the
  // cells' mean tensors.
  Possible<void> node_blocks(const SharedArrays& shared);
  Possible<void> mean_tensors(const SharedArrays& shared);
  /// After a gradient that keeps, at the same positions: what was kept becomes CellEnergy::keep_convex_part(). Only for
  /// the hyperelastic energy.
  Possible<void> keep_convex_part(const SharedArrays& shared);

  /// The results of scan(), by cell of the set.
  Possible<void> download_scans(std::span<CellScan> scans) const;

  /// Contributions: nodes of its cells, lanes past the last cell included.
  std::size_t contributions() const { return lanes() * static_cast<std::size_t>(set_.nodes_per_cell); }
  virtual std::size_t memory() const;

  // For those who work with its cells: the numbers and ranks of their nodes (batches × node × lane), and
  // mean_tensors().
  const Buffer& nodes() const { return nodes_; }
  const Buffer& ranks() const { return ranks_; }
  const Buffer& tensors() const { return tensors_; }
  const CellSet& cells() const { return set_; }
  std::int32_t batches() const { return (set_.count + kBatch - 1) / kBatch; }

  // What was kept by gradient(), as BatchSet has it; for tests.
  const Buffer& linearisation() const { return linearisation_; }
  const Buffer& deformation() const { return deformation_; }
  const Buffer& mean() const { return mean_; }

 protected:
  std::size_t lanes() const { return static_cast<std::size_t>(batches()) * kBatch; }
  /// The first of its contributions, of `width` numbers each.
  float* contributions_of(const SharedArrays& shared, int width) const {
    return shared.contributions + first_ * static_cast<std::size_t>(width);
  }
  Possible<void> find_kernels(const Module& kernels, std::span<const std::pair<const char*, Kernel*>> wanted);
  NormArguments norm_arguments(const SharedArrays& shared, int width) const;
  /// Copies what both kinds have: derivatives, nodes, ranks, targets, weights of points and cells; makes room for
  /// results.
  Possible<void> copy_cells(const Module& general);
  Possible<void> copy_targets();
  GeneralArguments general_arguments(const SharedArrays& shared) const;
  /// Runs a kernel with `per_batch` × lane threads per batch.
  Possible<void> run_general(const Kernel& kernel, int per_batch, GeneralArguments& arguments);
  /// Rearranges `size` numbers per cell to batch × number × lane. Lanes past the last cell repeat it.
  template <class T, class Number>
  std::vector<T> in_batches(int size, const Number& number) const;
  /// The arguments that both kinds of kernels have.
  template <class Arguments>
  Arguments common_arguments(const SharedArrays& shared) const;

  Device& device_;
  const CellSet& set_;
  const Material material_;
  const std::size_t first_;
  const std::vector<std::int32_t>& rank_of_;
  const std::vector<int> slots_;
  int entries_ = 0;  ///< KeptPartials::kEntries.

  Buffer weights_, nodes_, ranks_, inverse_target_, left_factor_, measure_, delta_squared_, slope_;
  Buffer derivatives_;  ///< As GeneralArguments::derivatives.
  Buffer scans_, linearisation_, deformation_, mean_, tensors_;
  Buffer norm_factor_, cell_gradients_, along_;  ///< Empty: no p-norm.
  Kernel keep_cell_gradients_, along_cell_gradients_, add_norm_terms_, node_block_, mean_tensor_, keep_convex_part_;
};

template <class T, class Number>
std::vector<T> SetOnDevice::in_batches(int size, const Number& number) const {
  std::vector<T> out;
  out.reserve(lanes() * static_cast<std::size_t>(size));
  for (std::int32_t b = 0; b < batches(); ++b)
    for (int i = 0; i < size; ++i)
      for (int lane = 0; lane < kBatch; ++lane)
        out.push_back(static_cast<T>(number(std::min(b * kBatch + lane, set_.count - 1), i)));
  return out;
}

template <class Arguments>
Arguments SetOnDevice::common_arguments(const SharedArrays& shared) const {
  Arguments a;
  a.material = material_;
  a.batches = batches();
  a.points = set_.points;
  a.affine = set_.affine;
  a.cell_nodes = nodes_.as<const std::int32_t>();
  a.weights = weights_.as<const double>();
  a.inverse_target = inverse_target_.as<const double>();
  a.left_factor = left_factor_.as<const double>();
  a.measure = measure_.as<const double>();
  a.delta_squared = delta_squared_.as<const double>();
  a.slope = slope_.as<const double>();
  a.positions = shared.positions;
  a.scans = scans_.as<double>();
  a.contributions = contributions_of(shared, 2 * set_.dimension);
  a.linearisation = linearisation_.as<float>();
  a.deformation = deformation_.as<std::int16_t>();
  a.mean = mean_.as<float>();
  return a;
}

}  // namespace varimesh::device
