// Matching the cells of two meshes.
#include "client/report/stages.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <unordered_map>

#include "core/mesh/check.h"

namespace varimesh::client {
namespace {

/// For each cell of `first` the one of `second` with its number and its count of nodes; empty where one has none.
std::vector<std::int32_t> match(const Cells& first, const Cells& second) {
  std::unordered_map<std::int64_t, std::int32_t> by_number;
  by_number.reserve(second.count());
  for (std::size_t c = 0; c < second.count(); ++c) by_number[second.number(c)] = static_cast<std::int32_t>(c);
  std::vector<std::int32_t> order(first.count());
  for (std::size_t c = 0; c < first.count(); ++c) {
    const auto found = by_number.find(first.number(c));
    if (found == by_number.end()) return {};
    order[c] = found->second;
    if (second.nodes(static_cast<std::size_t>(found->second)).size() != first.nodes(c).size()) return {};
  }
  return order;
}

}  // namespace

Expected<Stages> Stages::create(std::shared_ptr<const HighOrderMesh> before,
                                std::shared_ptr<const HighOrderMesh> after) {
  Stages stages;
  for (auto& mesh : {std::move(before), std::move(after)}) {
    if (mesh == nullptr) continue;
    if (const auto checked = check_structure(*mesh); !checked) return tl::unexpected(checked.error());
    stages.cells_.emplace_back(*mesh, mesh->dimension);
    Stage stage{mesh, match(stages.cells_[0], stages.cells_.back()), {}};
    if (stage.order.size() != stages.cells_[0].count() || stages.cells_.back().count() != stage.order.size())
      return bad_input("The mesh before and the mesh after do not have the same elements, so no report can show both.");
    const CellQuality quality = cell_quality(*mesh);
    for (const std::int32_t cell : stage.order)
      stage.scaled_jacobian.push_back(quality.scaled_jacobian[static_cast<std::size_t>(cell)]);
    stages.stages_.push_back(std::move(stage));
  }
  constexpr double kFar = std::numeric_limits<double>::max();
  stages.box_ = {kFar, kFar, kFar, -kFar, -kFar, -kFar};
  for (std::size_t i = 0; i < stages.mesh().coordinates.size(); ++i) {
    stages.box_[i % 3] = std::min(stages.box_[i % 3], stages.mesh().coordinates[i]);
    stages.box_[3 + i % 3] = std::max(stages.box_[3 + i % 3], stages.mesh().coordinates[i]);
  }
  for (std::size_t d = 0; d < 3; ++d) stages.centre_[d] = stages.box_[d] / 2 + stages.box_[3 + d] / 2;
  return stages;
}

std::array<double, 3> Stages::point(std::size_t stage, std::size_t cell, int local) const {
  const Stage& of = stages_[stage];
  const auto node = static_cast<std::size_t>(
      cells_[stage].nodes(static_cast<std::size_t>(of.order[cell]))[static_cast<std::size_t>(local)]);
  const std::vector<double>& x = of.mesh->coordinates;
  return {x[3 * node], x[3 * node + 1], x[3 * node + 2]};
}

std::array<double, 3> Stages::middle(std::size_t stage, std::size_t cell) const {
  const auto count = static_cast<int>(cells().nodes(cell).size());
  std::array<double, 3> sum{};
  for (int i = 0; i < count; ++i) {
    const auto node = point(stage, cell, i);
    for (std::size_t d = 0; d < 3; ++d) sum[d] += node[d] / count;
  }
  return sum;
}

double Stages::size(std::size_t stage, std::size_t cell) const {
  double largest = 0;
  const auto first = point(stage, cell, 0);
  for (int i = 1; i < static_cast<int>(cells().nodes(cell).size()); ++i) {
    const auto at = point(stage, cell, i);
    largest = std::max(largest, std::hypot(at[0] - first[0], at[1] - first[1], at[2] - first[2]));
  }
  return largest;
}

std::vector<std::int32_t> Stages::worst(std::size_t stage, std::size_t most) const {
  std::vector<std::int32_t> cells(this->cells().count());
  std::iota(cells.begin(), cells.end(), 0);
  const auto& js = stages_[stage].scaled_jacobian;
  const auto middle = cells.begin() + static_cast<std::ptrdiff_t>(std::min(most, cells.size()));
  std::partial_sort(cells.begin(), middle, cells.end(), [&](std::int32_t a, std::int32_t b) {
    const double left = js[static_cast<std::size_t>(a)], right = js[static_cast<std::size_t>(b)];
    return left != right ? left < right : a < b;
  });
  cells.resize(static_cast<std::size_t>(middle - cells.begin()));
  return cells;
}

}  // namespace varimesh::client
