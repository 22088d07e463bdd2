#include "core/problem/fixed_nodes.h"

#include <algorithm>
#include <charconv>
#include <numeric>
#include <span>
#include <string>
#include <unordered_map>

#include "core/problem/node_conversion.h"
#include "core/quality/quality.h"
#include "core/reference/nodes.h"

namespace varimesh {
namespace {

using Group = std::pair<int, int>;  // dimension, tag

// === Groups by name ======================================================================================

// Every physical group of the mesh: those with a name, and those that an element belongs to.
std::vector<Group> groups_of(const HighOrderMesh& mesh) {
  std::vector<Group> groups;
  for (const PhysicalGroup& group : mesh.physical_groups) groups.emplace_back(group.dimension, group.tag);
  for (const ElementBlock& block : mesh.blocks)
    for (const int tag : block.physical) groups.emplace_back(reference::info(block.shape).dimension, tag);
  std::sort(groups.begin(), groups.end());
  groups.erase(std::unique(groups.begin(), groups.end()), groups.end());
  return groups;
}

std::string list_groups(const HighOrderMesh& mesh) {
  std::string list;
  int listed = 0;
  for (const auto& [dimension, tag] : groups_of(mesh)) {
    if (++listed > 12) return list + ", …";
    const auto named = std::find_if(mesh.physical_groups.begin(), mesh.physical_groups.end(),
                                    [&](const PhysicalGroup& g) { return g.dimension == dimension && g.tag == tag; });
    const bool has_name = named != mesh.physical_groups.end() && !named->name.empty();
    list += (list.empty() ? "" : ", ") +
            (has_name ? "'" + named->name + "'" : std::to_string(dimension) + ":" + std::to_string(tag));
  }
  return list;
}

bool parse_whole(const std::string& text, std::size_t from, int& value) {
  const auto [stop, error] = std::from_chars(text.data() + from, text.data() + text.size(), value);
  return error == std::errc() && stop == text.data() + text.size();
}

// The groups that `text` means: a name, a tag or "dimension:tag".
Expected<std::vector<Group>> find_groups(const HighOrderMesh& mesh, const std::string& text) {
  std::vector<Group> found;
  for (const PhysicalGroup& group : mesh.physical_groups)
    if (group.name == text && !text.empty()) found.emplace_back(group.dimension, group.tag);
  if (!found.empty()) return found;
  const std::size_t colon = text.find(':');
  int tag = 0, dimension = -1;
  const bool is_tag = parse_whole(text, colon == std::string::npos ? 0 : colon + 1, tag) &&
                      (colon == std::string::npos || parse_whole(text.substr(0, colon), 0, dimension));
  for (const Group& group : groups_of(mesh))
    if (is_tag && group.second == tag && (dimension < 0 || group.first == dimension)) found.push_back(group);
  if (found.empty())
    return bad_option("The mesh has no physical group '" + text + "'. " +
                      (groups_of(mesh).empty() ? "It has none; name nodes with fix_nodes or free_nodes instead."
                                               : "Name one of its groups: " + list_groups(mesh) + "."));
  if (found.size() > 1)
    return bad_option("The tag " + text + " belongs to physical groups of " + std::to_string(found.size()) +
                      " dimensions: give 'dimension:tag', such as '" + std::to_string(found.front().first) + ":" +
                      text + "'.");
  return found;
}

bool is_in(const ElementBlock& block, const std::vector<Group>& groups) {
  const int dimension = reference::info(block.shape).dimension;
  return std::any_of(groups.begin(), groups.end(), [&](const Group& group) {
    return group.first == dimension &&
           std::find(block.physical.begin(), block.physical.end(), group.second) != block.physical.end();
  });
}

// === Fixing and freeing ==================================================================================

// Which nodes are fixed. The public functions are called in the order of their declaration.
class FixedNodes {
 public:
  FixedNodes(const HighOrderMesh& mesh, const Facets& facets)
      : mesh_(mesh), cells_(mesh, mesh.dimension), facets_(facets) {}

  // The outer boundary and all interfaces, except those of the groups in `free`.
  Expected<void> fix_boundary(const std::vector<std::string>& free) {
    std::vector<Group> freed;
    for (const std::string& text : free) {
      const auto groups = find_groups(mesh_, text);
      if (!groups) return tl::unexpected(groups.error());
      for (const Group& group : *groups)
        if (group.first != mesh_.dimension - 1)
          return bad_option("The group '" + text + "' has dimension " + std::to_string(group.first) +
                            ": only groups of " + (mesh_.dimension == 3 ? "faces" : "lines") +
                            " between cells can be freed, since only their nodes are fixed. Leave it out of free.");
      if (const auto checked = check_inside(text, *groups); !checked) return checked;
      freed.insert(freed.end(), groups->begin(), groups->end());
    }
    mark_outer();
    fixed_ = outer_;
    for (const ElementBlock& block : mesh_.blocks)
      if (reference::info(block.shape).dimension == mesh_.dimension - 1 && !is_in(block, freed)) fix_all(block.nodes);
    return {};
  }

  Expected<void> free_nodes(const std::vector<std::int64_t>& numbers) {
    const auto nodes = find_nodes(numbers, "free_nodes");
    if (!nodes) return tl::unexpected(nodes.error());
    for (std::size_t n = 0; n < nodes->size(); ++n)
      if ((*nodes)[n] && outer_[n])
        return bad_option(
            "Node " + std::to_string(mesh_.node_numbers[n]) +
            " cannot be freed: it lies on the outer boundary, and there is no geometry to slide on. Leave "
            "it out of free_nodes.");
    for_each_related(*nodes, [&](std::int32_t other, bool, bool bounded) {
      if (bounded) fixed_[std::size_t(other)] = false;
    });
    return {};
  }

  Expected<void> fix_groups(const std::vector<std::string>& names) {
    for (const std::string& text : names) {
      const auto groups = find_groups(mesh_, text);
      if (!groups) return tl::unexpected(groups.error());
      for (const ElementBlock& block : mesh_.blocks)
        if (is_in(block, *groups)) fix_all(block.nodes);
    }
    return {};
  }

  Expected<void> fix_nodes(const std::vector<std::int64_t>& numbers) {
    const auto nodes = find_nodes(numbers, "fix_nodes");
    if (!nodes) return tl::unexpected(nodes.error());
    for_each_related(*nodes, [&](std::int32_t other, bool bounds, bool) {
      if (bounds) fixed_[std::size_t(other)] = true;
    });
    return {};
  }

  void fix_outside_region(double below, int rings, int threads) {
    const std::vector<double> quality = cell_quality(mesh_, 0, threads).scaled_jacobian;
    std::vector<bool> inside(cells_.count());
    for (std::size_t cell = 0; cell < inside.size(); ++cell) inside[cell] = quality[cell] < below;
    add_rings(inside, rings);
    for (std::size_t cell = 0; cell < inside.size(); ++cell)
      if (!inside[cell]) fix_all(cells_.nodes(cell));
  }

  std::vector<bool> take() { return std::move(fixed_); }

 private:
  // Adds layers of cells around those inside. Looks at each cell once, however many layers there are.
  void add_rings(std::vector<bool>& inside, int rings) const {
    std::vector<std::size_t> end(mesh_.node_count(), 0);  // of the cells around each vertex
    for (std::size_t cell = 0; cell < inside.size(); ++cell)
      for (const std::int32_t vertex : vertices(cell)) ++end[std::size_t(vertex)];
    std::partial_sum(end.begin(), end.end(), end.begin());
    std::vector<std::size_t> around(end.empty() ? 0 : end.back()), begin = end, ring, next;
    for (std::size_t cell = 0; cell < inside.size(); ++cell) {
      for (const std::int32_t vertex : vertices(cell)) around[--begin[std::size_t(vertex)]] = cell;
      if (inside[cell]) ring.push_back(cell);
    }
    for (; rings > 0 && !ring.empty(); --rings, ring.swap(next)) {
      next.clear();
      for (const std::size_t cell : ring)
        for (const std::int32_t vertex : vertices(cell)) {
          const auto v = std::size_t(vertex);
          for (; begin[v] < end[v]; ++begin[v])  // whoever comes to this vertex later finds nothing new
            if (const std::size_t neighbour = around[begin[v]]; !inside[neighbour]) {
              inside[neighbour] = true;
              next.push_back(neighbour);
            }
        }
    }
  }

  template <class Nodes>
  void fix_all(const Nodes& nodes) {
    for (const std::int32_t node : nodes) fixed_[std::size_t(node)] = true;
  }

  void mark_outer() {
    outer_.assign(mesh_.node_count(), false);
    for (std::size_t cell = 0; cell < cells_.count(); ++cell)
      for (std::int32_t f = facets_.first[cell]; f < facets_.first[cell + 1]; ++f) {
        if (facets_.neighbour[std::size_t(f)] >= 0) continue;
        const auto nodes = cells_.nodes(cell);
        for (const int local : reference::facet_nodes(cells_.shape(cell), mesh_.order, f - facets_.first[cell]))
          outer_[std::size_t(nodes[std::size_t(local)])] = true;
      }
  }

  // Refuses groups that have an element on the outer boundary.
  Expected<void> check_inside(const std::string& text, const std::vector<Group>& groups) const {
    const Cells borders(mesh_, mesh_.dimension - 1);
    for (const auto& [facet, border] : facets_.elements)
      if (facets_.neighbour[std::size_t(facet)] < 0 && is_in(*borders.range_of(std::size_t(border)).block, groups))
        return bad_option("The group '" + text + "' cannot be freed: its element " +
                          std::to_string(borders.number(std::size_t(border))) +
                          " lies on the outer boundary, and there is no geometry to slide on. Only interfaces inside "
                          "the mesh can be freed.");
    return {};
  }

  Expected<std::vector<bool>> find_nodes(const std::vector<std::int64_t>& numbers, const char* option) const {
    std::vector<bool> wanted(mesh_.node_count(), false);
    if (numbers.empty()) return wanted;
    std::unordered_map<std::int64_t, std::size_t> index;
    for (std::size_t n = 0; n < mesh_.node_count(); ++n) index.emplace(mesh_.node_numbers[n], n);
    for (const std::int64_t number : numbers) {
      const auto found = index.find(number);
      if (found == index.end())
        return bad_option(std::string(option) + " has node " + std::to_string(number) +
                          ", which is not in the mesh: use the node numbers of the mesh file.");
      wanted[found->second] = true;
    }
    return wanted;
  }

  // Calls use(other node, other bounds it, it bounds other) for every wanted node and every node of its cells.
  template <class Use>
  void for_each_related(const std::vector<bool>& wanted, Use use) const {
    if (std::none_of(wanted.begin(), wanted.end(), [](bool is) { return is; })) return;
    for (std::size_t cell = 0; cell < cells_.count(); ++cell) {
      const auto nodes = cells_.nodes(cell);
      const reference::ShapeInfo& shape = reference::info(cells_.shape(cell));
      const auto& places = reference::node_places(shape.shape, mesh_.order);
      for (std::size_t i = 0; i < nodes.size(); ++i) {
        if (!wanted[std::size_t(nodes[i])]) continue;
        for (std::size_t j = 0; j < nodes.size(); ++j)
          use(nodes[j], in_closure(shape, places[j], places[i]), in_closure(shape, places[i], places[j]));
      }
    }
  }

  std::span<const std::int32_t> vertices(std::size_t cell) const {
    return cells_.nodes(cell).first(std::size_t(reference::info(cells_.shape(cell)).vertices));
  }

  const HighOrderMesh& mesh_;
  Cells cells_;
  const Facets& facets_;
  std::vector<bool> outer_;
  std::vector<bool> fixed_;
};

}  // namespace

Expected<std::vector<bool>> choose_fixed_nodes(const HighOrderMesh& mesh, const Options& options) {
  return choose_fixed_nodes(mesh, options, facets(mesh));
}

Expected<std::vector<bool>> choose_fixed_nodes(const HighOrderMesh& mesh, const Options& options,
                                               const Facets& facets) {
  FixedNodes fixed(mesh, facets);
  if (const auto done = fixed.fix_boundary(options.free); !done) return tl::unexpected(done.error());
  if (const auto done = fixed.free_nodes(options.free_nodes); !done) return tl::unexpected(done.error());
  if (const auto done = fixed.fix_groups(options.fix); !done) return tl::unexpected(done.error());
  if (const auto done = fixed.fix_nodes(options.fix_nodes); !done) return tl::unexpected(done.error());
  if (options.region_below > 0) fixed.fix_outside_region(options.region_below, options.rings, options.threads);
  return fixed.take();
}

}  // namespace varimesh
