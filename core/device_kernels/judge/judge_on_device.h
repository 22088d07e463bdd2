// Judges cells on a device: measures them for their certificates, and samples them for the quality report.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/device/queue.h"
#include "core/device/run_device.h"
#include "core/device_kernels/kernels/judge/arguments.h"
#include "core/quality/lattice_kernel.h"
#include "core/validity/cell_batches.h"
#include "core/validity/certificate_kernel.h"

namespace varimesh {

/// Does on the device of a run what detail::bernstein_kernel() and detail::sample_rows() do on the processor, with the
/// same bits where the processor fuses multiplications and additions. What is proved follows from that on the
/// processor: the bound on rounding, the answer, and all that the first look at a cell leaves open.
///
/// What takes memory on the device is allocated when a call begins and freed when it ends. After a fault the device is
/// given up as RunDevice says, and the processor does the rest of the certificates, or all samples. The next call tries
/// the device again, if it is still used.
class JudgeOnDevice final : public detail::MeasuresElsewhere, public detail::SamplesElsewhere {
 public:
  /// @param device  must outlive the object; it may come to be used no more
  JudgeOnDevice(device::RunDevice& device, int dimension) : run_(&device), dimension_(dimension) {}
  /// With a device that no run has. It must outlive the object.
  JudgeOnDevice(device::Device& device, int dimension) : device_(&device), dimension_(dimension) {}

  /// The fault of the last call, if there was one.
  const std::optional<device::Fault>& fault() const { return queue_->fault(); }

  bool take(std::span<const double> coordinates) override;
  bool measure(const detail::MeasureInput& input, std::vector<double>& measures) override;
  void forget() override;

  bool sample(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals, const Team& team,
              std::vector<detail::Extremes>& cells) override;

 private:
  struct Kernels {
    device::Kernel relative_nodes, convert, differentiate, cross, coefficients, measure, sample;
  };
  /// A detail::JacobianTable.
  struct Tables {
    device::Buffer row_start, column, value;
    struct Derivative {
      device::Buffer columns, weights, reciprocal;
    };
    std::array<Derivative, 3> derivative;
    device::Buffer cross_start, cross_pairs, jacobian_start, jacobian_pairs, factors, corners;
  };
  /// What is made of the cells that are measured together.
  struct Work {
    device::Buffer lists, relative, map, cross, jacobian, measures;
    std::array<device::Buffer, 3> derivative;
  };

  /// Null: the run uses none any more.
  device::Device* used_device() const { return run_ == nullptr ? device_ : run_->get(); }
  /// Makes a queue, and loads the kernels when it is called for the first time. False: there is no device.
  bool begin();
  /// Whether there was no fault in the queue. If there was one, the device is given up.
  bool is_well();
  const Tables& tables_of(const detail::JacobianTable& table, double sign);
  void make_room(const detail::JacobianTable& table, std::int64_t batches);
  void measure_together(const detail::MeasureInput& input, std::span<const std::int32_t* const> nodes,
                        std::span<double> measures);
  void launch_rows(const device::Kernel& kernel, device::RowArguments arguments, std::int64_t batches, int rows);
  device::MeasureArguments measures(const detail::JacobianTable& table, std::int64_t batches) const;
  /// Samples the cells of blocks that have one shape and order.
  void sample_alike(const std::vector<detail::CellBatch>& blocks, const detail::LatticeTable& table,
                    const device::Buffer& coordinates, const Team& team, std::vector<detail::Extremes>& cells);

  device::RunDevice* run_ = nullptr;  ///< Null: the device is no run's.
  device::Device* device_ = nullptr;  ///< Without a run.
  const int dimension_;
  std::unique_ptr<device::Module> module_;
  Kernels kernels_;
  std::optional<device::Queue> queue_;
  device::Buffer coordinates_;
  std::map<const detail::JacobianTable*, Tables> tables_;  ///< Of the cells that were measured since take().
  Work work_;
};

}  // namespace varimesh
