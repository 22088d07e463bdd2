#include "core/preconditioner/on_device/groups_on_device.h"

#include <algorithm>
#include <numeric>

#include "core/base/index.h"

namespace varimesh {

GroupsOnDevice::GroupsOnDevice(device::Queue& queue, const device::Module* solver, int dimension)
    : queue_(queue),
      dimension_(dimension),
      value_kernel_(queue.kernel(solver, "group_value")),
      product_kernel_(queue.kernel(solver, "group_product")),
      add_kernel_(queue.kernel(solver, "add_groups")) {}

void GroupsOnDevice::copy(const StretchedCells& stretched) {
  std::vector<std::int32_t> first, end, unknown;
  std::vector<std::int64_t> factor;
  std::vector<float> triangles, weight;
  for (const StretchedCells::Group& group : stretched.factors()) {
    if (group.inverse_factor.empty()) continue;
    const auto begins = static_cast<std::int32_t>(unknown.size());
    for (std::size_t n = 0; n < group.ranks.size(); ++n)
      for (int k = 0; k < dimension_; ++k) {
        unknown.push_back(group.ranks[n] * dimension_ + k);
        weight.push_back(group.weight[n]);
      }
    first.resize(unknown.size(), begins);
    end.resize(unknown.size(), static_cast<std::int32_t>(unknown.size()));
    factor.resize(unknown.size(), static_cast<std::int64_t>(triangles.size()));
    triangles.insert(triangles.end(), group.inverse_factor.begin(), group.inverse_factor.end());
  }
  rows_ = static_cast<std::int32_t>(unknown.size());
  // The rows of each unknown, in the order of the groups.
  std::vector<std::int32_t> rows_of(unknown.size()), own, begin;
  std::iota(rows_of.begin(), rows_of.end(), 0);
  std::ranges::stable_sort(rows_of, {}, [&](std::int32_t row) { return unknown[at(row)]; });
  for (std::size_t i = 0; i < rows_of.size(); ++i) {
    if (!own.empty() && own.back() == unknown[at(rows_of[i])]) continue;
    own.push_back(unknown[at(rows_of[i])]);
    begin.push_back(static_cast<std::int32_t>(i));
  }
  unknowns_ = static_cast<std::int32_t>(own.size());
  begin.push_back(rows_);
  queue_.fill(first_, first);
  queue_.fill(end_, end);
  queue_.fill(factor_, factor);
  queue_.fill(triangles_, triangles);
  queue_.fill(unknown_, unknown);
  queue_.fill(weight_, weight);
  queue_.fill(own_, own);
  queue_.fill(begin_, begin);
  queue_.fill(rows_of_, rows_of);
  value_ = queue_.room(unknown.size() * sizeof(float));
  product_ = queue_.room(unknown.size() * sizeof(float));
}

double GroupsOnDevice::add(const float* residual, float* z, device::Joiner& joiner) {
  if (rows_ == 0) return 0;
  device::GroupArguments a;
  a.rows = rows_;
  a.first = first_.as<const std::int32_t>();
  a.end = end_.as<const std::int32_t>();
  a.factor = factor_.as<const std::int64_t>();
  a.triangles = triangles_.as<const float>();
  a.unknown = unknown_.as<const std::int32_t>();
  a.weight = weight_.as<const float>();
  a.residual = residual;
  a.value = value_.as<float>();
  a.product = product_.as<float>();
  a.parts = joiner.parts(rows_);
  a.unknowns = unknowns_;
  a.own = own_.as<const std::int32_t>();
  a.begin = begin_.as<const std::int32_t>();
  a.rows_of = rows_of_.as<const std::int32_t>();
  a.z = z;
  queue_.launch(value_kernel_, rows_, a, device::kJoinBytes);
  const double along = joiner.sum(rows_);
  queue_.launch(product_kernel_, rows_, a);
  queue_.launch(add_kernel_, unknowns_, a);
  return along;
}

std::size_t GroupsOnDevice::memory() const {
  std::size_t bytes = 0;
  for (const device::Buffer* buffer :
       {&first_, &end_, &factor_, &triangles_, &unknown_, &weight_, &value_, &product_, &own_, &begin_, &rows_of_})
    bytes += buffer->bytes();
  return bytes;
}

}  // namespace varimesh
