#include "core/parts/seams.h"

#include <algorithm>
#include <array>
#include <tuple>
#include <utility>

#include "core/reference/nodes.h"

namespace varimesh {
namespace {

constexpr std::size_t kCellsPerTask = 2048;

/// Mixes the bits of a number (splitmix64).
std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

FacetKey key_of(const std::int64_t* vertices, std::size_t count) {
  FacetKey key{};
  for (std::size_t k = 0; k < count; ++k) {
    key[0] += mixed(std::uint64_t(vertices[k]));
    key[1] += mixed(~std::uint64_t(vertices[k]));
  }
  return key;
}

// ---------------------------------------------------------------------------------------------------------------------
// A facet as its cells on two ranks can compare it
// ---------------------------------------------------------------------------------------------------------------------

struct Mark {
  FacetKey key{};
  std::uint64_t nodes = 0;     ///< The same for two cells that have the same nodes at the same positions of the facet.
  std::int64_t direction = 0;  ///< 1 or −1: in which direction the cell lists the vertices.
};

/// The weights of a lattice point at the vertices: barycentric on lines and triangles, bilinear on quadrilaterals.
std::array<std::uint64_t, 4> weights(Shape shape, int order, const std::array<std::int8_t, 3>& at) {
  const int p = order, i = at[0], j = at[1];
  const auto w = [](int value) { return static_cast<std::uint64_t>(value); };
  if (shape == Shape::Line) return {w(p - i), w(i), 0, 0};
  if (shape == Shape::Triangle) return {w(p - i - j), w(i), w(j), 0};
  return {w((p - i) * (p - j)), w(i * (p - j)), w(i * j), w((p - i) * j)};
}

/// @param nodes the numbers of the facet's nodes, in the order of its shape
Mark mark_of(Shape shape, int order, const std::vector<std::int64_t>& nodes) {
  const auto count = static_cast<std::size_t>(reference::info(shape).vertices);
  Mark mark;
  mark.key = key_of(nodes.data(), count);
  std::array<std::uint64_t, 4> vertex{};
  for (std::size_t k = 0; k < count; ++k) vertex[k] = mixed(std::uint64_t(nodes[k]));
  const auto& lattice = reference::lattice(shape, order);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    // The sum of the weighted vertices says where the node is, however the cell turns the facet.
    std::uint64_t position = 0;
    const auto weight = weights(shape, order, lattice[n]);
    for (std::size_t k = 0; k < count; ++k) position += weight[k] * vertex[k];
    mark.nodes += mixed(position ^ mixed(~std::uint64_t(nodes[n])));
  }
  const auto first = static_cast<std::size_t>(
      std::ranges::min_element(nodes.begin(), nodes.begin() + std::ptrdiff_t(count)) - nodes.begin());
  // Two cells may have the same four vertices with different ones opposite to each other.
  if (count == 4) mark.nodes += mixed(vertex[first] ^ vertex[(first + 2) % 4]);
  const std::int64_t before = nodes[(first + count - 1) % count], after = nodes[(first + 1) % count];
  mark.direction = count == 2 ? (first == 0 ? 1 : -1) : after < before ? 1 : -1;
  return mark;
}

class Marker {
 public:
  Marker(const HighOrderMesh& mesh, const Cells& cells) : mesh_(mesh), cells_(cells) {}

  Mark of(std::size_t cell, std::size_t facet) const {
    const Shape shape = cells_.shape(cell);
    const auto all = cells_.nodes(cell);
    thread_local std::vector<std::int64_t> nodes;
    nodes.clear();
    for (const int local : reference::facet_nodes(shape, mesh_.order, static_cast<int>(facet)))
      nodes.push_back(number(all[static_cast<std::size_t>(local)]));
    return mark_of(reference::info(shape).facets[facet].shape, mesh_.order, nodes);
  }

  /// Of a whole element of one dimension less.
  FacetKey of_element(std::size_t element) const {
    std::array<std::int64_t, 4> vertices{};
    const auto count = static_cast<std::size_t>(reference::info(cells_.shape(element)).vertices);
    for (std::size_t k = 0; k < count; ++k) vertices[k] = number(cells_.nodes(element)[k]);
    return key_of(vertices.data(), count);
  }

 private:
  std::int64_t number(std::int32_t node) const { return mesh_.node_numbers[static_cast<std::size_t>(node)]; }

  const HighOrderMesh& mesh_;
  const Cells& cells_;
};

/// Calls visit(cell, facet of the cell, index in Facets).
template <class Visit>
void for_each_facet(const Cells& cells, const Facets& facets, std::size_t begin, std::size_t end, const Visit& visit) {
  for (std::size_t cell = begin; cell < end; ++cell)
    for (std::int32_t f = facets.first[cell]; f < facets.first[cell + 1]; ++f)
      visit(cell, static_cast<std::size_t>(f - facets.first[cell]), static_cast<std::size_t>(f));
  (void)cells;
}

void sort_distinct(std::vector<FacetKey>& keys) {
  std::ranges::sort(keys);
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
}

// ---------------------------------------------------------------------------------------------------------------------
// Facets without a neighbour in the part
// ---------------------------------------------------------------------------------------------------------------------

/// What a rank tells about such a facet.
struct Lone {
  Mark mark;
  std::int64_t group = 0, sense = 0;
};

/// Sorts out the facets that were sent to this rank.
void match(std::vector<Lone>& all, Seams& seams) {
  std::ranges::sort(all, {}, [](const Lone& one) { return std::pair(one.mark.key, one.group); });
  for (std::size_t first = 0, last = 0; first < all.size(); first = last) {
    while (last < all.size() && all[last].mark.key == all[first].mark.key) ++last;
    const Lone& one = all[first];
    if (last - first == 1) {
      seams.outer.push_back(one.mark.key);
      continue;
    }
    const Lone& other = all[first + 1];
    if (last - first > 2 || one.mark.nodes != other.mark.nodes) {
      seams.unclear.push_back(one.mark.key);
      continue;
    }
    const bool agrees = one.mark.direction != other.mark.direction;
    seams.all_agree &= agrees;
    seams.links.push_back({one.group, other.group, (agrees ? 1 : -1) * one.sense * other.sense});
  }
  const auto link = [](const GroupLink& each) { return std::tuple(each.one, each.other, each.relation); };
  std::ranges::sort(seams.links, {}, link);
  const auto again = std::ranges::unique(seams.links, {}, link);
  seams.links.erase(again.begin(), again.end());
}

/// Pairs of cells within the part whose facets are not clearly the same.
std::vector<FacetKey> unclear_pairs(const Cells& cells, const Facets& facets, const Marker& marker, const Team& team) {
  std::vector<char> is_unclear(facets.opposite.size());
  team.for_ranges(cells.count(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for_each_facet(cells, facets, begin, end, [&](std::size_t cell, std::size_t facet, std::size_t index) {
      const std::int32_t opposite = facets.opposite[index];
      if (opposite < 0 || static_cast<std::size_t>(opposite) < index) return;
      const auto other = static_cast<std::size_t>(facets.neighbour[index]);
      const auto there = static_cast<std::size_t>(opposite - facets.first[other]);
      is_unclear[index] = marker.of(cell, facet).nodes != marker.of(other, there).nodes ? 1 : 0;
    });
  });
  std::vector<FacetKey> keys;
  for_each_facet(cells, facets, 0, cells.count(), [&](std::size_t cell, std::size_t facet, std::size_t index) {
    if (is_unclear[index] != 0) keys.push_back(marker.of(cell, facet).key);
  });
  return keys;
}

/// The rank that sorts out what has this key.
std::size_t owner(const FacetKey& key, const Ranks& ranks) {
  return static_cast<std::size_t>(key[0] % static_cast<std::uint64_t>(ranks.count()));
}

template <class T>
std::vector<T> joined(const std::vector<std::vector<T>>& lists) {
  std::vector<T> all;
  for (const std::vector<T>& list : lists) all.insert(all.end(), list.begin(), list.end());
  return all;
}

}  // namespace

bool Seams::is_outer(const FacetKey& key) const { return std::ranges::binary_search(outer, key); }

bool Seams::is_notable(const FacetKey& key) const {
  return is_outer(key) || std::ranges::binary_search(borders, key) || std::ranges::binary_search(unclear, key);
}

FacetKey facet_key(const HighOrderMesh& mesh, const Cells& cells, std::size_t cell, std::size_t facet) {
  std::array<std::int64_t, 4> vertices{};
  std::size_t count = 0;
  for (const int local : reference::info(cells.shape(cell)).facets[facet].vertices)
    if (local >= 0)
      vertices[count++] =
          mesh.node_numbers[static_cast<std::size_t>(cells.nodes(cell)[static_cast<std::size_t>(local)])];
  return key_of(vertices.data(), count);
}

Seams find_seams(const Part& part, const Facets& facets, const detail::JoinedCells& joined_cells,
                 std::int64_t first_group, const Ranks& ranks, const Team& team) {
  const Cells cells(part.mesh, part.mesh.dimension), borders(part.mesh, part.mesh.dimension - 1);
  const Marker marker(part.mesh, cells);
  std::vector<std::vector<Lone>> to(static_cast<std::size_t>(ranks.count()));
  for_each_facet(cells, facets, 0, cells.count(), [&](std::size_t cell, std::size_t facet, std::size_t index) {
    if (facets.neighbour[index] >= 0) return;
    const Lone lone{marker.of(cell, facet), first_group + joined_cells.group[cell], joined_cells.sense[cell]};
    to[owner(lone.mark.key, ranks)].push_back(lone);
  });
  Seams seams;
  seams.all_agree = detail::all_agree(cells, facets, team);
  std::vector<Lone> came = joined(ranks.exchange_lists(to));
  match(came, seams);
  const std::vector<FacetKey> unclear = unclear_pairs(cells, facets, marker, team);
  seams.unclear.insert(seams.unclear.end(), unclear.begin(), unclear.end());
  const Marker border_marker(part.mesh, borders);
  for (std::size_t element = 0; element < borders.count(); ++element)
    seams.borders.push_back(border_marker.of_element(element));
  for (std::vector<FacetKey>* keys : {&seams.outer, &seams.unclear, &seams.borders}) {
    *keys = ranks.gather_everywhere(*keys);
    sort_distinct(*keys);
  }
  seams.all_agree = ranks.sum(std::int64_t{seams.all_agree ? 0 : 1}) == 0;
  seams.links = ranks.gather(seams.links);
  return seams;
}

std::vector<std::int32_t> possible_duplicates(const Part& part, const Ranks& ranks) {
  struct Twin {
    FacetKey key{};
    std::int64_t rank = 0, cell = 0;
  };
  const Cells cells(part.mesh, part.mesh.dimension);
  const Marker marker(part.mesh, cells);
  std::vector<std::vector<Twin>> to(static_cast<std::size_t>(ranks.count()));
  for (std::size_t cell = 0; cell < cells.count(); ++cell) {
    std::vector<std::int64_t> vertices;
    for (std::size_t k = 0; k < static_cast<std::size_t>(reference::info(cells.shape(cell)).vertices); ++k)
      vertices.push_back(part.mesh.node_numbers[static_cast<std::size_t>(cells.nodes(cell)[k])]);
    const FacetKey key = key_of(vertices.data(), vertices.size());
    to[owner(key, ranks)].push_back({key, ranks.rank(), std::int64_t(cell)});
  }
  std::vector<Twin> came = joined(ranks.exchange_lists(to));
  std::ranges::sort(came, {}, &Twin::key);
  std::vector<std::vector<std::int32_t>> found(static_cast<std::size_t>(ranks.count()));
  for (std::size_t i = 0; i < came.size(); ++i)
    if ((i > 0 && came[i].key == came[i - 1].key) || (i + 1 < came.size() && came[i].key == came[i + 1].key))
      found[static_cast<std::size_t>(came[i].rank)].push_back(static_cast<std::int32_t>(came[i].cell));
  return joined(ranks.exchange_lists(found));
}

}  // namespace varimesh
