#include "core/mesh/changes/serendipity_elements.h"

#include <algorithm>
#include <cmath>

#include "core/mesh/changes/remove_nodes.h"
#include "core/reference/serendipity.h"

namespace varimesh {

namespace {

/// Whether the nodes that a serendipity element does not have are where its functions put them.
bool is_serendipity_cell(const HighOrderMesh& mesh, const Eigen::MatrixXd& values, const std::int32_t* nodes) {
  constexpr double kSame = 1e-12;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto x = [&](Eigen::Index i) { return mesh.coordinates[3 * static_cast<std::size_t>(nodes[i]) + k]; };
    double size = 0;
    for (Eigen::Index i = 0; i < values.cols(); ++i) size = std::max(size, std::abs(x(i)));
    for (Eigen::Index i = 0; i < values.rows(); ++i) {
      double wanted = 0;
      for (Eigen::Index n = 0; n < values.cols(); ++n) wanted += values(i, n) * x(n);
      if (!(std::abs(wanted - x(values.cols() + i)) <= kSame * size)) return false;
    }
  }
  return true;
}

/// Takes away the nodes that the serendipity elements do not have. False if an element is none.
bool strip(const HighOrderMesh& mesh, ElementBlock& block) {
  const auto own = static_cast<std::size_t>(reference::serendipity_node_count(block.shape, block.order));
  if (own == 0) return false;
  const Eigen::MatrixXd& values = reference::serendipity_values(block.shape, block.order);
  const std::size_t stride = nodes_per_element(block);
  for (std::size_t e = 0; e < block.size(); ++e) {
    const std::int32_t* nodes = block.nodes.data() + e * stride;
    if (!is_serendipity_cell(mesh, values, nodes)) return false;
    std::copy_n(nodes, own, block.nodes.begin() + static_cast<std::ptrdiff_t>(e * own));
  }
  block.nodes.resize(block.size() * own);
  return true;
}

void mark(const HighOrderMesh& mesh, bool value, std::vector<bool>& nodes) {
  for (const ElementBlock& block : mesh.blocks)
    for (const std::int32_t node : block.nodes) nodes[static_cast<std::size_t>(node)] = value;
}

}  // namespace

std::size_t nodes_per_element(const ElementBlock& block) {
  return block.size() == 0 ? static_cast<std::size_t>(reference::node_count(block.shape, block.order))
                           : block.nodes.size() / block.size();
}

bool is_serendipity(const ElementBlock& block) {
  return block.size() > 0 &&
         nodes_per_element(block) < static_cast<std::size_t>(reference::node_count(block.shape, block.order));
}

std::optional<HighOrderMesh> as_serendipity(const HighOrderMesh& mesh, const std::vector<Shape>& shapes) {
  HighOrderMesh result = mesh;
  for (ElementBlock& block : result.blocks)
    if (block.size() > 0 && std::ranges::find(shapes, block.shape) != shapes.end() && !strip(mesh, block))
      return std::nullopt;
  std::vector<bool> keep(mesh.node_count(), true);  // nodes that no element has stay
  mark(mesh, false, keep);
  mark(result, true, keep);
  remove_nodes(result, keep);
  return result;
}

}  // namespace varimesh
