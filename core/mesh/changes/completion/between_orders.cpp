#include "core/mesh/changes/completion/between_orders.h"

#include <algorithm>
#include <numeric>

#include "core/reference/basis.h"
#include "core/reference/serendipity.h"

namespace varimesh::detail {

Eigen::MatrixXd values_at(Shape shape, int order, std::size_t nodes, const reference::Points& at, int ambient) {
  Eigen::MatrixXd values = reference::basis_values(shape, order, reference::NodeSet::Equispaced, ambient, at);
  const auto own = static_cast<Eigen::Index>(nodes);
  if (own == values.cols()) return values;
  return values.leftCols(own) + values.rightCols(values.cols() - own) * reference::serendipity_values(shape, order);
}

std::vector<int> same_nodes(Shape shape, int from, std::size_t from_nodes, int to) {
  const auto& old = reference::lattice(shape, from);
  const auto& fresh = reference::lattice(shape, to);
  std::vector<int> source(fresh.size(), -1);
  if (to % from != 0) {
    std::iota(source.begin(), source.begin() + reference::info(shape).vertices, 0);
    return source;
  }
  for (std::size_t k = 0; k < from_nodes; ++k) {
    const auto same = [&](const auto& at) {
      return std::ranges::equal(at, old[k], [&](int a, int b) { return a == b * (to / from); });
    };
    source[static_cast<std::size_t>(std::ranges::find_if(fresh, same) - fresh.begin())] = static_cast<int>(k);
  }
  return source;
}

std::vector<std::int32_t> number_new_nodes(HighOrderMesh& mesh, std::size_t first,
                                           std::vector<std::pair<int, int>> entities) {
  std::vector<std::int32_t> sequence(entities.size());
  std::iota(sequence.begin(), sequence.end(), 0);
  std::vector<NodeBlock>& blocks = mesh.node_blocks;
  const bool classified =
      !blocks.empty() && std::ranges::none_of(blocks, [](const auto& block) { return block.dimension < 0; });
  if (classified)
    std::ranges::stable_sort(sequence, {}, [&](std::int32_t i) { return entities[static_cast<std::size_t>(i)]; });
  else
    std::ranges::fill(entities, std::pair(-1, 0));
  const std::vector<double> old(mesh.coordinates.begin() + static_cast<std::ptrdiff_t>(3 * first),
                                mesh.coordinates.end());
  std::vector<std::int32_t> place(sequence.size());
  std::int64_t number = mesh.node_numbers.empty() ? 0 : *std::ranges::max_element(mesh.node_numbers);
  for (std::size_t i = 0; i < sequence.size(); ++i) {
    const auto from = static_cast<std::size_t>(sequence[i]);
    place[from] = static_cast<std::int32_t>(first + i);
    std::copy_n(old.begin() + static_cast<std::ptrdiff_t>(3 * from), 3,
                mesh.coordinates.begin() + static_cast<std::ptrdiff_t>(3 * (first + i)));
    mesh.node_numbers.push_back(++number);
    const auto [dimension, entity] = entities[from];
    if (blocks.empty() || (i == 0 && classified) || blocks.back().dimension != dimension ||
        blocks.back().entity != entity)
      blocks.push_back({dimension, entity, place[from], 0});
    ++blocks.back().count;
  }
  return place;
}

}  // namespace varimesh::detail
