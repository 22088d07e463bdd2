#include "core/device_kernels/judge/judge_check.h"

#include <vector>

#include "core/base/index.h"
#include "core/device/cpu_device.h"
#include "core/device_kernels/judge/judge_on_device.h"
#include "core/device_kernels/self_check.h"
#include "core/quality/quality.h"

namespace varimesh {
namespace {

/// What the kernels measure in the cells of a mesh, and what they sample.
device::Possible<std::vector<double>> judged(device::Device& device, const HighOrderMesh& mesh) {
  JudgeOnDevice judge(device, mesh.dimension);
  const ElementBlock& block = mesh.blocks.front();
  std::vector<const std::int32_t*> nodes;
  for (std::size_t cell = 0; cell < block.size(); ++cell)
    nodes.push_back(block.nodes.data() + cell * at(reference::node_count(block.shape, block.order)));
  std::vector<double> numbers;
  std::vector<detail::Extremes> samples(block.size());
  const detail::MeasureInput input{&detail::jacobian_table(block.shape, block.order), 0.25, 1, nodes};
  const bool is_done = judge.take(mesh.coordinates) && judge.measure(input, numbers) &&
                       judge.sample(mesh, mesh.coordinates, report_intervals(mesh.order), Team(1), samples);
  if (!is_done) return tl::unexpected(*judge.fault());
  for (const detail::Extremes& one : samples)
    numbers.insert(numbers.end(), {one.low, one.high, one.mean, one.distortion_low, one.distortion_high,
                                   static_cast<double>(one.low_at), static_cast<double>(one.high_at)});
  return numbers;
}

}  // namespace

device::Possible<void> check_judgement(device::Device& device) {
  const auto cpu = device::make_cpu_device();
  for (const HighOrderMesh& mesh : device::check_meshes()) {
    const auto ours = judged(device, mesh), theirs = judged(*cpu, mesh);
    if (!ours) return tl::unexpected(ours.error());
    if (!theirs) return tl::unexpected(theirs.error());
    if (!device::same_numbers(*ours, *theirs)) return device::other_numbers(device, mesh);
  }
  return {};
}

}  // namespace varimesh
