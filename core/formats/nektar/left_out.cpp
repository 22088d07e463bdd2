// What a file of Nektar++ does not have of a mesh.
#include "core/formats/common/left_out.h"

#include <algorithm>

#include "core/formats/mfem/space.h"
#include "core/formats/nektar/blending.h"
#include "core/formats/nektar/grid.h"
#include "core/formats/nektar/nektar.h"

namespace varimesh::formats {

namespace {

bool has_dimension(const ElementBlock& block, int dimension) {
  return reference::info(block.shape).dimension == dimension;
}

/// The cells whose interior is not the one that Nektar++ makes of their boundary, to within rounding.
std::int64_t other_interiors(const HighOrderMesh& mesh, const std::vector<std::int32_t>& vertices) {
  std::int64_t count = 0;
  if (mesh.dimension < 3) return 0;
  constexpr double kRounding = 1e-12;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> x;
  for (const ElementBlock& block : mesh.blocks) {
    if (!has_dimension(block, 3) || inner_node_count(block.shape, mesh.order) == 0) continue;
    const NektarBlending& blending = nektar_blending(block.shape, mesh.order);
    const auto nodes = std::size_t(reference::node_count(block.shape, mesh.order));
    x.resize(Eigen::Index(nodes), 3);
    NektarTurnedNodes turned_nodes(mesh.order);
    for (std::size_t e = 0; e < block.size(); ++e) {
      const std::span own(block.nodes.data() + e * nodes, nodes);
      std::array<std::int32_t, 8> numbers{};
      const auto corners = std::size_t(reference::info(block.shape).vertices);
      for (std::size_t v = 0; v < corners; ++v) numbers[v] = vertices[std::size_t(own[v])];
      const std::vector<int>& turned =
          turned_nodes.of(block.shape, nektar_turn(block.shape, {numbers.data(), corners}));
      for (std::size_t i = 0; i < nodes; ++i)
        x.row(Eigen::Index(i)) = Eigen::Map<const Eigen::RowVector3d>(mesh.coordinates.data() +
                                                                      3 * std::ptrdiff_t(own[std::size_t(turned[i])]));
      const auto boundary = x.topRows(blending.inside.cols());
      const double size = (x.colwise().maxCoeff() - x.colwise().minCoeff()).maxCoeff();
      const double gap = (blending.inside * boundary - x.bottomRows(blending.inside.rows())).lpNorm<Eigen::Infinity>();
      const double left = blending.outside.rows() == 0 ? 0 : (blending.outside * boundary).lpNorm<Eigen::Infinity>();
      if (!(std::max(gap, left) <= kRounding * std::max(size, x.lpNorm<Eigen::Infinity>()))) ++count;
    }
  }
  return count;
}

}  // namespace

std::string not_in_nektar(const HighOrderMesh& mesh) {
  const auto vertices = nektar_vertices(mesh);
  if (!vertices || mesh.dimension < 2) return "";
  LeftOut lost;
  lost.small_elements(mesh);
  const NektarGrid grid(mesh, *vertices);
  std::int64_t stray = 0;
  for (const ElementBlock& block : mesh.blocks) {
    const auto count = std::size_t(reference::node_count(block.shape, block.order));
    if (has_dimension(block, mesh.dimension - 1))
      for (std::size_t e = 0; e < block.size(); ++e)
        stray += grid.side(block.shape, {block.nodes.data() + e * count, count}) < 0 ? 1 : 0;
  }
  lost.stray_sides(stray);
  lost.add_if(!mesh.periodic.empty(), "periodic links");
  lost.entities_and_partitions(mesh);
  // A file's numbers are counted in the order of its lists, as a reader of it counts them.
  lost.numbers_if(!grid.has_file_order() || !are_nodes_counted(mesh) ||
                  !are_elements_counted(mesh, {mesh.dimension, mesh.dimension - 1}));
  std::string text = lost.sentence("Nektar++'s format");
  if (const std::int64_t n = other_interiors(mesh, *vertices); n > 0)
    text += (text.empty() ? "" : " ") +
            std::string("Nektar++ makes the interior of cells from their edges and faces; ") + std::to_string(n) +
            (n == 1 ? " cell gets" : " cells get") +
            " another interior than the mesh has, so judge the quality of the file itself";
  return text;
}

}  // namespace varimesh::formats
