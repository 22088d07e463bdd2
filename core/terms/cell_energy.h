// The energy of the cells of a problem as a function of the positions of its free nodes.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/aligned.h"
#include "core/base/stopwatch.h"
#include "core/base/team.h"
#include "core/base/work_meter.h"
#include "core/kernels/hessian/batches.h"
#include "core/kernels/hessian/operations.h"
#include "core/kernels/kernels.h"
#include "core/kernels/p_norm.h"
#include "core/problem/problem.h"
#include "core/ranks/whole_reduction.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// Call it between two uses of the same memory for numbers of different kinds. The compiler takes it that such numbers
/// do not share memory; it moves no access over this call.
inline void change_kind_of_numbers() { std::atomic_signal_fence(std::memory_order_seq_cst); }

/// The sum over the cells of the energy ∫ W(F) |det A| dξ, or of the p-norm's terms of it, or with a weight for each
/// cell. δ of each cell is CellSet::delta_squared.
///
/// Works from the positions of the nodes: it computes deformation gradients a batch of cells at a time and does not
/// hold them. Gradient and energy are in double precision (each cell's contribution to the gradient has 48 bits);
/// products are in single precision, of the Hessian at deformation gradients that are held to 16 bits
/// (BatchSet::deformation). All references must outlive the object. Call all functions inside team.run().
///
/// The problem may be the part that a rank has of a whole problem. Then all ranks call fit_scale(), value(),
/// rounding(), noise(), gradient(), linearise(), for_blocks() and multiply() together. Each rank sums up the nodes that
/// it owns, and all results have the same bits as without ranks.
class CellEnergy {
 public:
  /// `share`: null, or what the rank has of the whole problem.
  CellEnergy(Problem& problem, const Kernels& kernels, const HessianKernels& hessian, const PNorm& norm,
             const Team& team, const ProblemShare* share = nullptr);
  ~CellEnergy();
  CellEnergy(const CellEnergy&) = delete;
  CellEnergy& operator=(const CellEnergy&) = delete;

  /// From now on the sum has these weights, divided by `volume`. Only for the p-norm that is the sum.
  /// @param weights  by CellSet::first + cell; they must outlive the object or the next call
  void weigh(std::span<const double> weights, double volume) {
    weights_ = weights;
    volume_ = volume;
  }

  /// Reports what the kernels do to `meter`, and the cells of a gradient or of blocks, as they are done, to `cells`.
  /// Both may be null and must outlive the object. `point`: the operations of the kernels' energy.
  void count_with(WorkMeter* meter, const PointOperations& point, WorkMeter* cells = nullptr) {
    meter_ = meter;
    cells_meter_ = cells;
    operations_ = mesh_operations(batches_, point);
  }
  /// How many cells are reported in a gradient, and once more in the blocks.
  std::int64_t gradient_work() const;

  // === The energy ===
  /// Scans every cell.
  void scan();
  /// Of the last scan(), gradient() or linearise(), by CellSet::first + cell.
  std::span<const CellScan> scans() const { return scans_; }
  /// The sum of the last scans; +∞ if a cell without δ has J ≤ 0 at a quadrature point, or if it is not finite.
  double value();
  /// The factor of rounding errors in the cells' densities: Σ slope V over the cells.
  double rounding();
  /// If value() changes by less, the change may be rounding.
  double noise() { return 100 * (1e-14 * rounding()); }

  // === Derivatives ===
  /// Chooses a power of two by which the Hessian is divided in blocks and products, so that it fits single precision.
  /// The p-norm's Hessian is estimated as the energy's Hessian times the largest slope of a cell. Without this call it
  /// is 1.
  void fit_scale();
  double scale() const { return scale_; }

  // === For those who compute scans and derivatives of the cells elsewhere ===
  /// By cell, as scans(): scan() in another place.
  std::span<CellScan> scans_to_fill() { return scans_; }
  /// As fit_scale(), from the scans there are.
  void fit_scale_to_scans();
  /// Sets CellSet::energy_slope from the scans: the slopes of the sum, over scale().
  void set_slopes();
  /// By cell: the p-norm's curvatures at the scans, over scale(). Empty if the norm is the sum.
  std::vector<double> curvatures() const;

  /// Sets the gradient, d numbers per own free node. It has no meaning if value() is infinite.
  void gradient(std::span<double> gradient);
  /// The same, bit for bit; also keeps what the functions below need.
  void linearise(std::span<double> gradient);
  /// Replaces what linearise() has kept by a positive semidefinite part of the Hessian: the terms with f_J ∂²J are left
  /// out, and f_JJ is at least λ/(J² + δ²). Only for a hyperelastic energy.
  void keep_convex_part(const Material& material);
  /// Calls use(rank, block) for each own free node, from several threads at once: its own block of the Hessian over
  /// scale(), lower triangle by rows.
  template <class Use>
  void for_blocks(const Use& use) {
    node_blocks();
    team_.for_each(own_nodes_, kNodesPerTask, [&](std::int32_t rank) { use(rank, added_up_block(rank)); });
  }
  /// product = Hessian over scale() times direction; returns direction · product. Both have d floats per free node,
  /// then padded(d) zeros. The product is set at the own nodes; the direction must be up to date at all free nodes.
  double multiply(std::span<const float> direction, std::span<float> product);

  std::vector<BatchSet>& batches() { return batches_; }
  /// The memory of the contributions of the largest set, as double precision numbers without a value: room for d
  /// numbers per node of each of its cells. gradient(), linearise(), for_blocks() and multiply() overwrite it. Between
  /// two of these calls others may use it, and begin with change_kind_of_numbers().
  std::span<double> room();

 private:
  static constexpr std::int32_t kNodesPerTask = 256;
  /// Gives the contributions room for those of the ghosts.
  void make_room_for_ghosts();
  /// The ghosts' contributions, `width` numbers per node of a cell, come from the ranks that work on these cells.
  void exchange_contributions(int width);
  /// The own nodes whose places in the whole problem are multiples of `stride`.
  std::vector<std::int32_t> every(std::int64_t stride) const;
  /// Calls work(set, b, F) for each batch, with the deformation gradients of its cells, after these were scanned and
  /// have their slopes.
  template <class Work>
  void for_batches(const Work& work);
  void add_up_gradient(std::span<double> gradient);
  void node_blocks();
  std::array<double, 6> added_up_block(std::int32_t rank) const;
  /// What a cell's energy is multiplied by, over scale().
  double slope(const CellSet& set, std::int32_t cell) const;
  /// The largest absolute entry of a free node's own block of the energy's Hessian.
  double largest_entry(std::int32_t rank);
  /// Only for the p-norm: keeps the cells' gradients, for the term with its curvature.
  void keep_cell_gradients(std::size_t set, std::int32_t b);
  /// Only for the p-norm: adds g (g · direction) of each cell of the batch to its contributions.
  void add_norm_term(std::size_t set, std::int32_t b, std::span<const float> direction);
  void count_batch() const {
    if (cells_meter_ != nullptr) cells_meter_->add(kBatch);
  }
  /// Tells the meter what the kernels have done in a loop that all threads have shared since the stopwatch started.
  void count_kernels(double operations, const Stopwatch& watch) const {
    if (meter_ != nullptr) meter_->add_kernels({operations, watch.seconds() * team_.threads()});
  }

  Problem& problem_;
  const Kernels& kernels_;
  const HessianKernels& hessian_;
  PNorm norm_;
  const Team& team_;
  const ProblemShare* share_;
  std::int32_t own_nodes_;  ///< So many at the beginning of Problem::free.
  WholeReduction reduction_;
  std::vector<BatchSet> batches_;
  std::span<const double> weights_;  ///< By cell; empty: all are 1.
  double volume_ = 1;
  double scale_ = 1;
  /// By set, as BatchSet::contributions of width d: √curvature g. Only for p ≠ 1.
  std::vector<AlignedVector<float>> cell_gradients_;
  std::vector<CellScan> scans_;  ///< By cell.
  WorkMeter *meter_ = nullptr, *cells_meter_ = nullptr;
  MeshOperations operations_;
};

}  // namespace varimesh
