// Cells are measured for their certificates.
#include <algorithm>

#include "core/base/index.h"
#include "core/device_kernels/judge/judge_on_device.h"
#include "core/kernels/hessian/batch.h"

namespace varimesh {
namespace {

using detail::JacobianTable;

static_assert(detail::kMeasuredTogether == kBatch);

/// About as many bytes of coefficients are on the device at a time: enough for all its threads, and little enough to
/// stay in the caches of a large card.
constexpr std::size_t kBytesTogether = std::size_t{32} << 20;

std::int32_t narrow(std::int64_t number) { return static_cast<std::int32_t>(number); }

/// Bytes of all coefficients of a batch.
std::size_t bytes_of_batch(const JacobianTable& table) {
  const std::size_t d = at(table.dimension);
  std::size_t numbers = at(table.nodes + table.map.size()) * d + at(table.jacobian.size());
  for (std::size_t r = 0; r < d; ++r) numbers += table.difference[r].size() * d;
  if (d == 3) numbers += at(table.cross.size()) * 3;
  return numbers * kBatch * sizeof(double);
}

/// The pairs of a convolution, or of the differences of a derivative, one after another.
std::span<const std::uint16_t> flat(const std::vector<std::array<std::uint16_t, 2>>& pairs) {
  return pairs.empty() ? std::span<const std::uint16_t>() : std::span(pairs.front().data(), 2 * pairs.size());
}

}  // namespace

const JudgeOnDevice::Tables& JudgeOnDevice::tables_of(const JacobianTable& table, double sign) {
  const auto [found, is_new] = tables_.try_emplace(&table);
  Tables& to = found->second;
  if (!is_new) return to;
  queue_->fill(to.row_start, table.row_start);
  queue_->fill(to.column, table.column);
  queue_->fill(to.value, table.value);
  for (std::size_t r = 0; r < at(table.dimension); ++r) {
    std::vector<std::uint16_t> columns;
    std::vector<double> weights;
    for (const detail::Difference& one : table.difference[r]) {
      columns.insert(columns.end(), {one.plus, one.minus});
      weights.insert(weights.end(), {one.plus_weight, one.minus_weight});
    }
    queue_->fill(to.derivative[r].columns, columns);
    queue_->fill(to.derivative[r].weights, weights);
    queue_->fill(to.derivative[r].reciprocal, table.derivative_reciprocal[r]);
  }
  queue_->fill(to.cross_start, table.cross_terms.start);
  queue_->fill(to.cross_pairs, flat(table.cross_terms.pairs));
  queue_->fill(to.jacobian_start, table.jacobian_terms.start);
  queue_->fill(to.jacobian_pairs, flat(table.jacobian_terms.pairs));
  std::vector<double> factors;
  for (const double reciprocal : table.jacobian_reciprocal) factors.push_back(reciprocal * sign);
  queue_->fill(to.factors, factors);
  queue_->fill(to.corners, table.corners);
  return to;
}

void JudgeOnDevice::make_room(const JacobianTable& table, std::int64_t batches) {
  const auto need = [&](device::Buffer& buffer, std::size_t numbers_of_cell) {
    const std::size_t bytes = numbers_of_cell * at(batches) * kBatch * sizeof(double);
    if (buffer.bytes() < bytes) buffer = queue_->room(bytes);
  };
  const std::size_t d = at(table.dimension);
  need(work_.relative, at(table.nodes) * d);
  need(work_.map, at(table.map.size()) * d);
  for (std::size_t r = 0; r < d; ++r) need(work_.derivative[r], table.difference[r].size() * d);
  if (d == 3) need(work_.cross, at(table.cross.size()) * d);
  need(work_.jacobian, at(table.jacobian.size()));
  need(work_.measures, detail::measures_of(table));
}

void JudgeOnDevice::launch_rows(const device::Kernel& kernel, device::RowArguments arguments, std::int64_t batches,
                                int rows) {
  arguments.batches = narrow(batches);
  arguments.rows = rows;
  queue_->launch(kernel, batches * rows * kBatch, arguments);
}

device::MeasureArguments JudgeOnDevice::measures(const JacobianTable& table, std::int64_t batches) const {
  const Tables& tables = tables_.at(&table);
  device::MeasureArguments a;
  a.batches = narrow(batches);
  a.nodes = table.nodes;
  a.coefficients = table.jacobian.size();
  a.corners = narrow(std::ssize(table.corners));
  for (std::size_t r = 0; r < at(table.dimension); ++r) {
    a.of_derivative[r] = narrow(std::ssize(table.difference[r]));
    a.reciprocal[r] = tables.derivative[r].reciprocal.as<const double>();
    a.derivative[r] = work_.derivative[r].as<const double>();
  }
  a.corner = tables.corners.as<const std::uint16_t>();
  a.relative = work_.relative.as<const double>();
  a.jacobian = work_.jacobian.as<const double>();
  a.to = work_.measures.as<double>();
  return a;
}

void JudgeOnDevice::measure_together(const detail::MeasureInput& input, std::span<const std::int32_t* const> nodes,
                                     std::span<double> measures_out) {
  const JacobianTable& table = *input.table;
  const Tables& tables = tables_of(table, input.sign);
  const std::int64_t batches = (std::ssize(nodes) + kBatch - 1) / kBatch;
  make_room(table, batches);
  std::vector<std::int32_t> lists;
  lists.reserve(nodes.size() * at(table.nodes));
  for (const std::int32_t* const list : nodes) lists.insert(lists.end(), list, list + table.nodes);
  queue_->fill(work_.lists, lists);
  queue_->launch(kernels_.relative_nodes, batches * table.nodes * kBatch,
                 device::RelativeArguments{narrow(std::ssize(nodes)), table.nodes, input.scale,
                                           work_.lists.as<const std::int32_t>(), coordinates_.as<const double>(),
                                           work_.relative.as<double>()});
  const auto* const map = work_.map.as<const double>();
  launch_rows(kernels_.convert,
              {.from_rows = table.nodes,
               .start = tables.row_start.as<const std::uint32_t>(),
               .columns = tables.column.as<const std::uint16_t>(),
               .values = tables.value.as<const double>(),
               .from = work_.relative.as<const double>(),
               .to = work_.map.as<double>()},
              batches, table.map.size());
  std::array<int, 3> sizes{};
  for (std::size_t r = 0; r < at(table.dimension); ++r) {
    sizes[r] = narrow(std::ssize(table.difference[r]));
    launch_rows(kernels_.differentiate,
                {.from_rows = table.map.size(),
                 .columns = tables.derivative[r].columns.as<const std::uint16_t>(),
                 .values = tables.derivative[r].weights.as<const double>(),
                 .from = map,
                 .to = work_.derivative[r].as<double>()},
                batches, sizes[r]);
  }
  const bool is_space = table.dimension == 3;
  if (is_space)
    launch_rows(kernels_.cross,
                {.from_rows = sizes[1],
                 .other_rows = sizes[2],
                 .start = tables.cross_start.as<const std::uint32_t>(),
                 .columns = tables.cross_pairs.as<const std::uint16_t>(),
                 .from = work_.derivative[1].as<const double>(),
                 .other = work_.derivative[2].as<const double>(),
                 .to = work_.cross.as<double>()},
                batches, table.cross.size());
  launch_rows(kernels_.coefficients,
              {.from_rows = sizes[0],
               .other_rows = is_space ? table.cross.size() : sizes[1],
               .start = tables.jacobian_start.as<const std::uint32_t>(),
               .columns = tables.jacobian_pairs.as<const std::uint16_t>(),
               .factors = tables.factors.as<const double>(),
               .from = work_.derivative[0].as<const double>(),
               .other = (is_space ? work_.cross : work_.derivative[1]).as<const double>(),
               .to = work_.jacobian.as<double>()},
              batches, table.jacobian.size());
  queue_->launch(kernels_.measure, batches * kBatch, measures(table, batches));
  queue_->download(work_.measures, measures_out);
}

bool JudgeOnDevice::measure(const detail::MeasureInput& input, std::vector<double>& out) {
  const std::size_t numbers = detail::measures_of(*input.table), count = input.nodes.size();
  const std::size_t together = std::max<std::size_t>(1, kBytesTogether / bytes_of_batch(*input.table)) * kBatch;
  out.resize((count + kBatch - 1) / kBatch * kBatch * numbers);
  for (std::size_t first = 0; first < count && queue_->is_well(); first += together) {
    const std::size_t size = std::min(together, count - first);
    measure_together(input, input.nodes.subspan(first, size),
                     std::span(out).subspan(first * numbers, (size + kBatch - 1) / kBatch * kBatch * numbers));
  }
  return is_well();
}

}  // namespace varimesh
