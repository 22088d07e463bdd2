// Facets are matched by their sorted vertices. They are put into buckets by the smallest vertex and sorted within each
// bucket, which has about a dozen entries. This needs no map and no allocation per facet.
#include "core/mesh/connectivity.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/base/shared_work.h"
#include "core/reference/nodes.h"

namespace varimesh {

Cells::Cells(const HighOrderMesh& mesh, int dimension) {
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != dimension || block.size() == 0) continue;
    ranges_.push_back({&block, count_, std::size_t(reference::node_count(block.shape, block.order))});
    count_ += block.size();
  }
}

const Cells::Range& Cells::range_of(std::size_t cell) const {
  assert(cell < count_);
  return *std::prev(std::upper_bound(ranges_.begin(), ranges_.end(), cell,
                                     [](std::size_t c, const Range& range) { return c < range.first; }));
}

std::span<const std::int32_t> Cells::nodes(std::size_t cell) const {
  const Range& at = range_of(cell);
  return {at.block->nodes.data() + (cell - at.first) * at.stride, at.stride};
}

std::int64_t Cells::number(std::size_t cell) const {
  const Range& at = range_of(cell);
  return at.block->numbers[cell - at.first];
}

// === Matching ============================================================================================

namespace {

constexpr std::int32_t kNone = -1;
constexpr std::size_t kCellsPerTask = 2048, kBucketsPerTask = 4096;

// A facet in the bucket of its smallest vertex: the other vertices, ascending, and the facet's index. Boundary elements
// have indices after those of the facets.
struct Entry {
  std::array<std::int32_t, 3> rest;
  std::int32_t facet;
  friend bool operator<(const Entry& a, const Entry& b) {
    for (std::size_t k = 0; k < 3; ++k)
      if (a.rest[k] != b.rest[k]) return a.rest[k] < b.rest[k];
    return a.facet < b.facet;
  }
};

// Without branches, whose outcome nobody can foresee.
inline void sort_four(std::array<std::int32_t, 4>& v) {
  const auto order = [&](std::size_t a, std::size_t b) {
    const std::int32_t low = std::min(v[a], v[b]), high = std::max(v[a], v[b]);
    v[a] = low;
    v[b] = high;
  };
  order(0, 1);
  order(2, 3);
  order(0, 2);
  order(1, 3);
  order(1, 2);
}

// Calls visit(facet, sorted vertices) for the facets of all cells whose smallest vertex is one of those from `low` to
// `high - 1`, in no particular order. Missing vertices are the largest int. Returns the number of facets.
template <class Visit>
std::int32_t visit_facets(const Cells& cells, std::size_t low, std::size_t high, const Team& team, const Visit& visit) {
  std::int32_t first = 0;
  for (const Cells::Range& range : cells.ranges()) {
    const auto shape_facets = reference::info(range.block->shape).facets;
    const auto per_cell = std::int32_t(shape_facets.size());
    team.for_ranges(range.block->size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        const std::int32_t* nodes = range.block->nodes.data() + e * range.stride;
        std::int32_t facet = first + std::int32_t(e) * per_cell;
        for (const reference::Facet& local : shape_facets) {
          const std::int32_t own = facet++;
          std::array<std::int32_t, 4> vertices;
          for (std::size_t k = 0; k < 4; ++k)
            vertices[k] = local.vertices[k] < 0 ? std::numeric_limits<std::int32_t>::max()
                                                : nodes[std::size_t(local.vertices[k])];
          if (std::size_t(*std::min_element(vertices.begin(), vertices.end())) - low >= high - low) continue;
          sort_four(vertices);
          visit(own, vertices);
        }
      }
    });
    first += std::int32_t(range.block->size()) * per_cell;
  }
  return first;
}

// The same for the vertices of boundary elements, whose indices start at `facet`.
template <class Visit>
void visit_elements(const Cells& elements, std::int32_t facet, const Visit& visit) {
  for (const Cells::Range& range : elements.ranges()) {
    const auto count = std::size_t(reference::info(range.block->shape).vertices);
    for (std::size_t e = 0; e < range.block->size(); ++e) {
      std::array<std::int32_t, 4> vertices;
      vertices.fill(std::numeric_limits<std::int32_t>::max());
      std::copy_n(range.block->nodes.data() + e * range.stride, count, vertices.begin());
      sort_four(vertices);
      visit(facet++, vertices);
    }
  }
}

// What the buckets of one task contribute to the lists of Facets.
struct Found {
  std::vector<std::pair<std::int32_t, std::int32_t>> elements;
  std::int32_t crowded = kNone;
  std::size_t crowded_count = 0;

  void add_to(Facets& result) const {
    result.elements.insert(result.elements.end(), elements.begin(), elements.end());
    if (crowded >= 0 && (result.crowded < 0 || crowded < result.crowded)) result.crowded = crowded;
    result.crowded_count += crowded_count;
  }
};

// Tells facets with the same vertices apart. In a mesh of order 2 and above, two cells can meet at two vertices with
// two sides between them, for example the halves of a ring. Boundary elements have indices after those of the facets.
class Sides {
 public:
  Sides(const HighOrderMesh& mesh, const Cells& cells, const Cells& borders, const Facets& facets)
      : mesh_(mesh), cells_(cells), borders_(borders), facets_(facets) {}

  // Whether two facets with the same vertices are one: if they have the same nodes, or at least lie at the same place.
  // Then their cells should have shared the nodes, which check_conformity() says.
  bool are_one(std::int32_t a, std::int32_t b) const {
    if (mesh_.order == 1) return true;
    std::vector<std::int32_t> own = nodes(a), other = nodes(b);
    std::sort(own.begin(), own.end());
    std::sort(other.begin(), other.end());
    if (own == other || own.size() != other.size()) return true;
    constexpr double kSame = 1e-6;
    double distance = 0, size = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto x = [&](std::int32_t node) { return mesh_.coordinates[3 * std::size_t(node) + k]; };
      double sum = 0;
      for (std::size_t i = 0; i < own.size(); ++i) {
        sum += (x(own[i]) - x(other[i])) / double(own.size());
        size = std::max(size, std::abs(x(own[i]) - x(own[0])));
      }
      distance = std::max(distance, std::abs(sum));
    }
    return distance <= kSame * size;
  }

 private:
  std::vector<std::int32_t> nodes(std::int32_t facet) const {
    const std::int32_t total = facets_.first.back();
    if (facet >= total) {
      const auto all = borders_.nodes(std::size_t(facet - total));
      return {all.begin(), all.end()};
    }
    const auto after = std::upper_bound(facets_.first.begin(), facets_.first.end(), facet);
    const auto cell = std::size_t(after - facets_.first.begin()) - 1;
    std::vector<std::int32_t> list;
    for (const int local : reference::facet_nodes(cells_.shape(cell), mesh_.order, facet - facets_.first[cell]))
      list.push_back(cells_.nodes(cell)[std::size_t(local)]);
    return list;
  }

  const HighOrderMesh& mesh_;
  const Cells &cells_, &borders_;
  const Facets& facets_;
};

// Records that the facets and boundary elements in `same` are one facet. Indices from `total` on are boundary elements.
void link(Facets& result, Found& found, std::span<const Entry> same, std::int32_t total) {
  const auto border = std::find_if(same.begin(), same.end(), [&](const Entry& e) { return e.facet >= total; });
  const auto cells = std::size_t(border - same.begin());
  for (std::size_t k = 0; k < cells && border != same.end(); ++k)
    found.elements.emplace_back(same[k].facet, border->facet - total);
  if (cells > 2) {
    if (found.crowded < 0 || same[0].facet < found.crowded) found.crowded = same[0].facet;
    ++found.crowded_count;
  }
  if (cells < 2) return;
  result.opposite[std::size_t(same[0].facet)] = same[1].facet;
  result.opposite[std::size_t(same[1].facet)] = same[0].facet;
}

// Finds the entries of one bucket that have the same vertices. Few have more than two cells and a boundary element;
// these may be different facets.
void link_bucket(Facets& result, Found& found, std::span<Entry> bucket, std::int32_t total, const Sides& sides) {
  std::sort(bucket.begin(), bucket.end());
  for (std::size_t a = 0, b = 0; a < bucket.size(); a = b) {
    while (b < bucket.size() && bucket[b].rest == bucket[a].rest) ++b;
    const auto alike = bucket.subspan(a, b - a);
    if (alike.size() < 3 || (alike.size() == 3 && alike[2].facet >= total)) {
      link(result, found, alike, total);
      continue;
    }
    std::vector<Entry> left(alike.begin(), alike.end());
    while (!left.empty()) {
      const std::int32_t first = left.front().facet;
      const auto others = std::stable_partition(left.begin(), left.end(),
                                                [&](const Entry& e) { return sides.are_one(first, e.facet); });
      link(result, found, {left.data(), std::size_t(others - left.begin())}, total);
      left.erase(left.begin(), others);
    }
  }
}

// Two cells that share several facets may do so only by the vertices.
void separate(Facets& result, const Sides& sides) {
  std::vector<std::int32_t> apart;
  for (std::size_t cell = 0; cell + 1 < result.first.size(); ++cell)
    for (std::int32_t f = result.first[cell]; f < result.first[cell + 1]; ++f)
      for (std::int32_t g = f + 1; g < result.first[cell + 1]; ++g) {
        const std::int32_t other = result.neighbour[std::size_t(f)];
        if (other < 0 || other != result.neighbour[std::size_t(g)]) continue;
        for (const std::int32_t one : {f, g})
          if (!sides.are_one(one, result.opposite[std::size_t(one)])) apart.push_back(one);
      }
  for (const std::int32_t facet : apart)
    result.neighbour[std::size_t(facet)] = result.opposite[std::size_t(facet)] = kNone;
  if (apart.empty()) return;
  std::sort(apart.begin(), apart.end());
  const std::int32_t total = result.first.back();
  std::erase_if(result.elements, [&](const auto& pair) {
    return std::binary_search(apart.begin(), apart.end(), pair.first) &&
           !sides.are_one(pair.first, total + pair.second);
  });
}

// The threads fill the buckets in any order. The buckets are sorted afterwards, so this does not show.
void match(Facets& result, const HighOrderMesh& mesh, const Cells& cells, const Cells& borders, const Sides& sides,
           const Team& team) {
  const std::int32_t total = result.first.back();
  std::vector<std::int32_t> start(mesh.node_count() + 1, 0);
  const auto tally = [&](std::int32_t, const std::array<std::int32_t, 4>& v) {
    count_up(start[std::size_t(v[0]) + 1], team);
  };
  visit_facets(cells, 0, mesh.node_count(), team, tally);
  visit_elements(borders, total, tally);
  for (std::size_t i = 1; i < start.size(); ++i) start[i] += start[i - 1];

  // One range of vertices at a time, so that the entries of a large mesh are never all in memory. They would be the
  // largest table of all checks.
  constexpr std::int32_t kEntries = std::int32_t(1) << 21;
  std::vector<Entry> entries;
  for (std::size_t low = 0, high = 0; low < mesh.node_count(); low = high) {
    const std::int32_t base = start[low];
    high = low + 1;
    while (high < mesh.node_count() && start[high + 1] - base <= kEntries) ++high;
    entries.resize(std::size_t(start[high] - base));
    std::vector<std::int32_t> next(start.begin() + std::ptrdiff_t(low), start.begin() + std::ptrdiff_t(high));
    const auto enter = [&](std::int32_t facet, const std::array<std::int32_t, 4>& v) {
      const auto bucket = std::size_t(v[0]) - low;
      if (bucket < next.size()) entries[std::size_t(count_up(next[bucket], team) - base)] = {{v[1], v[2], v[3]}, facet};
    };
    visit_facets(cells, low, high, team, enter);
    visit_elements(borders, total, enter);
    std::vector<Found> found(chunks_of(high - low, kBucketsPerTask));
    for_chunks(team, high - low, kBucketsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      for (std::size_t node = low + begin; node < low + end; ++node)
        link_bucket(result, found[chunk],
                    {entries.data() + (start[node] - base), std::size_t(start[node + 1] - start[node])}, total, sides);
    });
    for (const Found& part : found) part.add_to(result);
  }
}

std::atomic<std::int64_t> searches = 0;

}  // namespace

std::int64_t facet_searches() { return searches; }

Facets facets(const HighOrderMesh& mesh, const Team& team) {
  ++searches;
  const Cells cells(mesh, mesh.dimension);
  Facets result;
  result.first.reserve(cells.count() + 1);
  std::int32_t total = 0;
  for (const Cells::Range& range : cells.ranges())
    for (std::size_t e = 0; e < range.block->size(); ++e) {
      result.first.push_back(total);
      total += std::int32_t(reference::info(range.block->shape).facets.size());
    }
  result.first.push_back(total);
  result.opposite.assign(std::size_t(total), kNone);
  const Cells borders(mesh, mesh.dimension - 1);
  const Sides sides(mesh, cells, borders, result);
  match(result, mesh, cells, borders, sides, team);
  sort_distinct(team, result.elements);
  // Filled only now, so that this table and the entries in match() are not in memory at the same time.
  result.neighbour.assign(std::size_t(total), kNone);
  team.for_ranges(cells.count(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t cell = begin; cell < end; ++cell)
      for (std::int32_t f = result.first[cell]; f < result.first[cell + 1]; ++f)
        if (const std::int32_t other = result.opposite[std::size_t(f)]; other >= 0)
          result.neighbour[std::size_t(other)] = std::int32_t(cell);
  });
  if (mesh.order > 1) separate(result, sides);
  return result;
}

// === Fixed nodes =========================================================================================

std::vector<bool> fixed_nodes(const HighOrderMesh& mesh, const Facets& facets) {
  std::vector<bool> fixed(mesh.node_count(), false);
  const Cells cells(mesh, mesh.dimension);
  for (const Cells::Range& range : cells.ranges()) {
    const ElementBlock& block = *range.block;
    const std::size_t facet_count = reference::info(block.shape).facets.size();
    for (std::size_t e = 0; e < block.size(); ++e)
      for (std::size_t f = 0; f < facet_count; ++f) {
        if (facets.neighbour[std::size_t(facets.first[range.first + e]) + f] >= 0) continue;
        for (int local : reference::facet_nodes(block.shape, block.order, int(f)))
          fixed[std::size_t(block.nodes[e * range.stride + std::size_t(local)])] = true;
      }
  }
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension - 1)
      for (std::int32_t node : block.nodes) fixed[std::size_t(node)] = true;
  return fixed;
}

std::vector<bool> fixed_nodes(const HighOrderMesh& mesh) { return fixed_nodes(mesh, facets(mesh)); }

}  // namespace varimesh
