// Which surface of the geometry each element of a surface of the mesh lies on.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/association/match.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

/// The cosine between the normals of an element and of a surface is at least this.
constexpr double kSameDirection = 0.5;

class Elements {
 public:
  Elements(const HighOrderMesh& mesh, const Candidates& candidates, double tolerance)
      : mesh_(mesh), candidates_(candidates), tolerance_(tolerance), near_(mesh.node_count()) {}

  /// Finds the surfaces on which a node lies.
  void look_around(std::int32_t node) {
    const Eigen::Vector3d x = position(node);
    for (std::size_t s = 0; s < candidates_.count(); ++s) {
      if (!candidates_.may_contain(s, x)) continue;
      const double distance = candidates_.closest(s, x).distance;
      if (distance <= tolerance_) near_[index(node)].emplace_back(static_cast<int>(s), distance);
    }
  }

  /// The surface of an element; −1: none that is sure.
  int surface_of(Shape shape, std::span<const std::int32_t> nodes) const {
    std::vector<Near> all = near_[index(nodes[0])];
    for (const std::int32_t node : nodes.subspan(1)) keep_common(all, near_[index(node)]);
    if (all.empty()) return -1;
    // The same margin as for a surface as a whole.
    const double least = std::ranges::min(all, {}, &Near::second).second;
    std::erase_if(all, [&](const Near& one) { return one.second > 2 * least + 1e-3 * tolerance_; });
    for (const Middle middle : {Middle::Inside, Middle::Anywhere}) {
      std::vector<int> surfaces;
      for (const Near& one : all)
        if (std::isfinite(misfit(shape, nodes, one.first, middle)) && holds_vertices(shape, nodes, one.first))
          surfaces.push_back(one.first);
      candidates_.keep_parts(surfaces);
      if (!surfaces.empty())
        return std::ranges::min(surfaces, {}, [&](int s) { return misfit(shape, nodes, s, middle); });
    }
    return -1;
  }

 private:
  using Near = std::pair<int, double>;                    ///< A surface, and how far from it a node lies.
  enum class Middle : std::uint8_t { Inside, Anywhere };  ///< Where the middle of an element may lie.

  static std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }
  Eigen::Vector3d position(std::int32_t node) const {
    return Eigen::Map<const Eigen::Vector3d>(&mesh_.coordinates[3 * index(node)]);
  }

  /// Keeps what both have, with the larger distance. Both are sorted by surface.
  static void keep_common(std::vector<Near>& all, const std::vector<Near>& of_node) {
    std::erase_if(all, [&](Near& one) {
      const auto other = std::ranges::lower_bound(of_node, one.first, {}, &Near::first);
      if (other == of_node.end() || other->first != one.first) return true;
      one.second = std::max(one.second, other->second);
      return false;
    });
  }

  bool holds_vertices(Shape shape, std::span<const std::int32_t> nodes, int s) const {
    return std::ranges::all_of(nodes.first(index(reference::info(shape).vertices)), [&](std::int32_t node) {
      return candidates_.holds(index(s), position(node), tolerance_);
    });
  }

  /// How far the middle of the straight-sided element lies from the surface, and how far the element has turned away
  /// from it there, as a length. Infinite if its middle is where it may not be, or if it runs in another direction.
  double misfit(Shape shape, std::span<const std::int32_t> nodes, int s, Middle where) const {
    const auto vertices = index(reference::info(shape).vertices);
    Eigen::Vector3d middle = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
    for (std::size_t k = 0; k < vertices; ++k) {
      middle += position(nodes[k]) / static_cast<double>(vertices);
      // From a vertex: far from the origin, products of the positions themselves would cancel.
      const Eigen::Vector3d to = position(nodes[k]) - position(nodes[0]);
      normal += to.cross(position(nodes[(k + 1) % vertices]) - position(nodes[0]));
    }
    const geometry::SurfaceFoot foot = candidates_.closest(index(s), middle);
    const geometry::SurfaceShape& of = *candidates_.surface(index(s)).shape;
    if (where == Middle::Inside && !of.contains(foot.u, foot.v)) return std::numeric_limits<double>::infinity();
    const Eigen::Vector3d there = of.normal(of.at(foot.u, foot.v), foot.u, foot.v);
    const double cosine = there.isZero() || normal.isZero() ? 1 : std::abs(there.dot(normal.normalized()));
    if (cosine < kSameDirection) return std::numeric_limits<double>::infinity();
    return foot.distance + (1 - cosine) * std::sqrt(normal.norm());
  }

  const HighOrderMesh& mesh_;
  const Candidates& candidates_;
  const double tolerance_;
  std::vector<std::vector<Near>> near_;  ///< By node.
};

}  // namespace

void match_elements(const HighOrderMesh& mesh, const std::vector<int>& tags, const Candidates& candidates,
                    double tolerance, const Team& team, std::vector<std::vector<int>>& surface_of_element) {
  const auto counts = [&](const ElementBlock& block) {
    return reference::info(block.shape).dimension == 2 && std::ranges::binary_search(tags, block.entity);
  };
  std::vector<std::int32_t> nodes;
  for (const ElementBlock& block : mesh.blocks)
    if (counts(block)) nodes.insert(nodes.end(), block.nodes.begin(), block.nodes.end());
  std::ranges::sort(nodes);
  const auto repeated = std::ranges::unique(nodes);
  nodes.erase(repeated.begin(), repeated.end());
  Elements elements(mesh, candidates, tolerance);
  team.for_each(static_cast<std::int32_t>(nodes.size()), 16,
                [&](std::int32_t i) { elements.look_around(nodes[static_cast<std::size_t>(i)]); });
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const ElementBlock& block = mesh.blocks[b];
    if (!counts(block)) continue;
    const auto stride = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
    team.for_each(static_cast<std::int32_t>(block.size()), 16, [&](std::int32_t i) {
      const auto e = static_cast<std::size_t>(i);
      const int surface = elements.surface_of(block.shape, {&block.nodes[e * stride], stride});
      if (surface >= 0) surface_of_element[b][e] = surface;
    });
  }
}

}  // namespace varimesh::detail
