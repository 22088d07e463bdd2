#include "client/report/snapshots.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <unordered_map>

#include "core/mesh/check.h"

namespace varimesh::client {
namespace {

/// For each cell of `first`, the cell of `second` with the same number and the same count of nodes. Empty if one of the
/// cells has no such partner.
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

std::array<double, 6> box_of(const HighOrderMesh& mesh, const Cells& cells) {
  constexpr double kFar = std::numeric_limits<double>::max();
  std::array<double, 6> box{kFar, kFar, kFar, -kFar, -kFar, -kFar};
  for (std::size_t cell = 0; cell < cells.count(); ++cell)
    for (const std::int32_t node : cells.nodes(cell))
      for (std::size_t d = 0; d < 3; ++d) {
        const double x = mesh.coordinates[3 * static_cast<std::size_t>(node) + d];
        box[d] = std::min(box[d], x);
        box[3 + d] = std::max(box[3 + d], x);
      }
  return box;
}

}  // namespace

Expected<Snapshots> Snapshots::create(std::shared_ptr<const HighOrderMesh> before,
                                      std::shared_ptr<const HighOrderMesh> after) {
  Snapshots snapshots;
  for (auto& mesh : {std::move(before), std::move(after)}) {
    if (mesh == nullptr) continue;
    if (const auto checked = check_structure(*mesh); !checked) return tl::unexpected(checked.error());
    snapshots.cells_.emplace_back(*mesh, mesh->dimension);
    Snapshot snapshot{mesh, match(snapshots.cells_[0], snapshots.cells_.back()), {}};
    if (snapshot.order.size() != snapshots.cells_[0].count() ||
        snapshots.cells_.back().count() != snapshot.order.size())
      return bad_input("The meshes before and after do not have the same elements, so a report cannot show both.");
    const CellQuality quality = cell_quality(*mesh);
    for (const std::int32_t cell : snapshot.order)
      snapshot.scaled_jacobian.push_back(quality.scaled_jacobian[static_cast<std::size_t>(cell)]);
    snapshots.snapshots_.push_back(std::move(snapshot));
  }
  snapshots.box_ = box_of(snapshots.mesh(), snapshots.cells());
  for (std::size_t d = 0; d < 3; ++d) snapshots.centre_[d] = snapshots.box_[d] / 2 + snapshots.box_[3 + d] / 2;
  return snapshots;
}

std::array<double, 3> Snapshots::point(std::size_t snapshot, std::size_t cell, int local) const {
  const Snapshot& in = snapshots_[snapshot];
  const auto node = static_cast<std::size_t>(
      cells_[snapshot].nodes(static_cast<std::size_t>(in.order[cell]))[static_cast<std::size_t>(local)]);
  const std::vector<double>& x = in.mesh->coordinates;
  return {x[3 * node], x[3 * node + 1], x[3 * node + 2]};
}

std::array<double, 3> Snapshots::middle(std::size_t snapshot, std::size_t cell) const {
  const auto count = static_cast<int>(cells().nodes(cell).size());
  std::array<double, 3> sum{};
  for (int i = 0; i < count; ++i) {
    const auto node = point(snapshot, cell, i);
    for (std::size_t d = 0; d < 3; ++d) sum[d] += node[d] / count;
  }
  return sum;
}

double Snapshots::size(std::size_t snapshot, std::size_t cell) const {
  double largest = 0;
  const auto first = point(snapshot, cell, 0);
  for (int i = 1; i < static_cast<int>(cells().nodes(cell).size()); ++i) {
    const auto other = point(snapshot, cell, i);
    largest = std::max(largest, std::hypot(other[0] - first[0], other[1] - first[1], other[2] - first[2]));
  }
  return largest;
}

std::vector<std::int32_t> Snapshots::worst(std::size_t snapshot, std::size_t most) const {
  std::vector<std::int32_t> cells(this->cells().count());
  std::iota(cells.begin(), cells.end(), 0);
  const auto& js = snapshots_[snapshot].scaled_jacobian;
  const auto middle = cells.begin() + static_cast<std::ptrdiff_t>(std::min(most, cells.size()));
  std::partial_sort(cells.begin(), middle, cells.end(), [&](std::int32_t a, std::int32_t b) {
    const double left = js[static_cast<std::size_t>(a)], right = js[static_cast<std::size_t>(b)];
    return left != right ? left < right : a < b;
  });
  cells.resize(static_cast<std::size_t>(middle - cells.begin()));
  return cells;
}

}  // namespace varimesh::client
