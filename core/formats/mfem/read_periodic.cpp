// Cuts periodic meshes open: MFEM's cells share vertices there, but are at different places.
#include <array>
#include <map>

#include "core/formats/common/reading_notes.h"
#include "core/formats/mfem/read.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

using Place = std::array<double, 3>;

/// A side of a cell on the cut.
struct CutSide {
  std::size_t block, element;
  int facet;
};

/// Two sides of cells that are the same side in the file. The second is at the place of the first and `shift`.
struct Pair {
  CutSide first, second;
  Place shift{};
};

class Cutting {
 public:
  Cutting(MfemReading& reading, const std::vector<double>& places)
      : reading_(reading), mesh_(reading.mesh), places_(places) {}

  void apply() {
    take_nodes();
    find_pairs();
    follow_cells();
    for (std::size_t b = 0; b < own_.size(); ++b)
      if (is_cells(mesh_.blocks[b])) own_[b].swap(mesh_.blocks[b].nodes);  // own_ has the numbers of the file now
    std::size_t links = 0;
    for (const auto& [name, pairs] : grouped()) add_link(++links, pairs);
    note_reading(mesh_, {"The mesh is periodic. It was cut open along " + std::to_string(pairs_.size()) +
                         (pairs_.size() == 1 ? " side" : " sides") +
                         " of elements, and periodic links pair the nodes of " + "both sides of the cut."});
  }

 private:
  bool is_cells(const ElementBlock& block) const { return reference::info(block.shape).dimension == mesh_.dimension; }
  std::size_t stride(const ElementBlock& block) const {
    return std::size_t(reference::node_count(block.shape, reading_.nodes.space.order));
  }

  // === Nodes =============================================================================================

  /// Each cell takes the copies of its nodes that are where it is. The first copy has the node's number.
  void take_nodes() {
    std::int32_t count = 0;
    for (const ElementBlock& block : mesh_.blocks)
      for (const std::int32_t node : block.nodes) count = std::max(count, node + 1);
    next_.assign(std::size_t(count), -1);
    std::vector<double>& x = mesh_.coordinates;
    x.assign(3 * std::size_t(count), 0.0);
    placed_.assign(std::size_t(count), false);
    std::size_t at = 0;
    own_.resize(mesh_.blocks.size());
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      const ElementBlock& block = mesh_.blocks[b];
      if (!is_cells(block)) continue;
      reading_.scanner.reserve(own_[b], block.nodes.size());
      const std::size_t n = stride(block);
      for (std::size_t e = 0; e < block.size(); ++e, at += n) {
        reading_.scanner.look();
        const Place size = size_of(at, n);
        for (std::size_t i = 0; i < n; ++i) own_[b].push_back(copy_of(block.nodes[e * n + i], at + i, size));
      }
    }
  }

  Place size_of(std::size_t first, std::size_t count) const {
    Place low, high;
    low.fill(HUGE_VAL), high.fill(-HUGE_VAL);
    for (std::size_t i = first; i < first + count; ++i)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], places_[3 * i + k]);
        high[k] = std::max(high[k], places_[3 * i + k]);
      }
    return {high[0] - low[0], high[1] - low[1], high[2] - low[2]};
  }

  std::int32_t copy_of(std::int32_t node, std::size_t at, const Place& size) {
    std::vector<double>& x = mesh_.coordinates;
    const auto is_here = [&](std::int32_t copy) {
      for (std::size_t k = 0; k < 3; ++k)
        if (!is_one_place(x[3 * std::size_t(copy) + k], places_[3 * at + k], size[k])) return false;
      return true;
    };
    if (!placed_[std::size_t(node)]) {
      placed_[std::size_t(node)] = true;
      std::copy_n(places_.begin() + std::ptrdiff_t(3 * at), 3, x.begin() + std::ptrdiff_t{3} * node);
      return node;
    }
    std::int32_t copy = node;
    for (;; copy = next_[std::size_t(copy)]) {
      if (is_here(copy)) return copy;
      if (next_[std::size_t(copy)] < 0) break;
    }
    if (next_.size() >= std::size_t(kMostNodes)) reading_.scanner.fail("the mesh has too many nodes");
    reading_.scanner.make_room(x, 3);
    reading_.scanner.take_memory(2 * sizeof(std::int32_t));
    const auto made = std::int32_t(next_.size());
    next_[std::size_t(copy)] = made;
    next_.push_back(-1);
    x.insert(x.end(), places_.begin() + std::ptrdiff_t(3 * at), places_.begin() + std::ptrdiff_t(3 * at + 3));
    return made;
  }

  bool has_copies(std::int32_t node) const { return next_[std::size_t(node)] >= 0; }

  // === Sides =============================================================================================

  using Corners = std::array<std::int32_t, 4>;

  /// The sorted vertices of a side, by the numbers of `nodes`; the first is −2 if none has copies.
  Corners corners(const reference::Facet& side, const std::int32_t* nodes) const {
    Corners found{-1, -1, -1, -1};
    bool is_cut = false;
    for (std::size_t v = 0; v < std::size_t(reference::info(side.shape).vertices); ++v) {
      found[v] = nodes[side.vertices[v]];
      is_cut = is_cut || has_copies(found[v]);
    }
    if (!is_cut) return {-2, -2, -2, -2};
    std::sort(found.begin(), found.end());
    return found;
  }

  /// Two cells with a side of the same vertices, which have different copies of these.
  void find_pairs() {
    std::map<Corners, CutSide> open;
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      const ElementBlock& block = mesh_.blocks[b];
      if (!is_cells(block)) continue;
      const auto facets = reference::info(block.shape).facets;
      for (std::size_t e = 0; e < block.size(); ++e)
        for (std::size_t f = 0; f < facets.size(); ++f) {
          const Corners key = corners(facets[f], block.nodes.data() + e * stride(block));
          if (key[0] == -2) continue;
          reading_.scanner.take_memory(kTreeNode + sizeof(CutSide));
          const CutSide side{b, e, int(f)};
          const auto [at, is_new] = open.try_emplace(key, side);
          if (is_new) continue;
          const auto there = nodes_of(at->second, own_), here = nodes_of(side, own_);
          if (there != here) {
            check_alike(there, here, block.numbers[e]);
            add_pair(at->second, side);
          }
          open.erase(at);
        }
    }
  }

  /// The nodes of a side, by the number that the file has for each: of `nodes`, one list for each block.
  std::map<std::int32_t, std::int32_t> nodes_of(const CutSide& side,
                                                const std::vector<std::vector<std::int32_t>>& own) const {
    const ElementBlock& block = mesh_.blocks[side.block];
    std::map<std::int32_t, std::int32_t> nodes;
    for (const int local : reference::facet_nodes(block.shape, reading_.nodes.space.order, side.facet)) {
      const std::size_t at = side.element * stride(block) + std::size_t(local);
      nodes[block.nodes[at]] = own[side.block][at];
    }
    return nodes;
  }

  /// Both sides of a cut have the same size and shape, and no node in common. `number`: of the second cell.
  void check_alike(const std::map<std::int32_t, std::int32_t>& there, const std::map<std::int32_t, std::int32_t>& here,
                   std::int64_t number) const {
    constexpr double kSame = 1e-4;
    const auto distance = [&](std::int32_t a, std::int32_t b) {
      double squares = 0;
      for (std::size_t k = 0; k < 3; ++k) {
        const double d = mesh_.coordinates[3 * std::size_t(a) + k] - mesh_.coordinates[3 * std::size_t(b) + k];
        squares += d * d;
      }
      return std::sqrt(squares);
    };
    const auto a = *there.begin(), b = *here.begin();
    bool alike = true;
    for (const auto& [node, copy] : there) {
      const std::int32_t other = here.at(node);
      const double one = distance(a.second, copy), two = distance(b.second, other);
      alike = alike && copy != other && std::abs(one - two) <= kSame * std::max(one, two);
    }
    if (!alike)
      reading_.scanner.fail("element " + std::to_string(number) +
                            " (counted from 1) has a vertex, edge or face in common with an element that is elsewhere, "
                            "and the mesh is not periodic there: it has gaps; give VariMesh the mesh without them");
  }

  void add_pair(CutSide first, CutSide second) {
    reading_.scanner.take_memory(sizeof(Pair));
    Pair pair{first, second, shift_between(first, second)};
    const auto lead = std::find_if(pair.shift.begin(), pair.shift.end(), [&](double d) {
      return std::abs(d) > 0.5 * std::max({std::abs(pair.shift[0]), std::abs(pair.shift[1]), std::abs(pair.shift[2])});
    });
    if (lead != pair.shift.end() && *lead < 0) {  // so that all pairs of a direction agree on what is first
      std::swap(pair.first, pair.second);
      for (double& d : pair.shift) d = -d;
    }
    pairs_.push_back(pair);
  }

  Place shift_between(const CutSide& first, const CutSide& second) const {
    const auto a = nodes_of(first, own_), b = nodes_of(second, own_);
    const auto from = std::size_t(a.begin()->second), to = std::size_t(b.at(a.begin()->first));
    Place shift;
    for (std::size_t k = 0; k < 3; ++k) shift[k] = mesh_.coordinates[3 * to + k] - mesh_.coordinates[3 * from + k];
    return shift;
  }

  /// Boundary elements of the file take the copies of the first cell that has them.
  void follow_cells() {
    std::map<std::vector<std::int32_t>, CutSide> of_cells;
    std::map<std::vector<std::int32_t>, std::pair<std::size_t, std::size_t>> wanted;
    const auto key = [](std::vector<std::int32_t> nodes) {
      std::sort(nodes.begin(), nodes.end());
      return nodes;
    };
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      const ElementBlock& block = mesh_.blocks[b];
      if (is_cells(block)) continue;
      const std::size_t n = stride(block);
      for (std::size_t e = 0; e < block.size(); ++e) {
        const auto* nodes = block.nodes.data() + e * n;
        if (std::none_of(nodes, nodes + n, [&](std::int32_t node) { return has_copies(node); })) continue;
        reading_.scanner.take_memory(kTreeNode + kAllocation + n * sizeof(std::int32_t));
        wanted[key({nodes, nodes + n})] = {b, e};
      }
    }
    if (wanted.empty()) return;
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b) {
      const ElementBlock& block = mesh_.blocks[b];
      if (!is_cells(block)) continue;
      for (std::size_t e = 0; e < block.size(); ++e)
        for (std::size_t f = 0; f < reference::info(block.shape).facets.size(); ++f) {
          const auto nodes = nodes_of({b, e, int(f)}, own_);
          std::vector<std::int32_t> side;
          for (const auto& [node, copy] : nodes) side.push_back(node);
          const auto found = wanted.find(side);
          if (found == wanted.end()) continue;
          ElementBlock& boundary = mesh_.blocks[found->second.first];
          const std::size_t n = stride(boundary);
          for (std::size_t i = 0; i < n; ++i) {
            std::int32_t& node = boundary.nodes[found->second.second * n + i];
            node = nodes.at(node);
          }
          wanted.erase(found);
        }
    }
  }

  // === Links =============================================================================================

  /// The pairs of each direction. A mesh that repeats by turning has as many directions as sides; it has one link.
  std::map<std::size_t, std::vector<const Pair*>> grouped() const {
    std::vector<Place> shifts;
    std::map<std::size_t, std::vector<const Pair*>> groups;
    constexpr double kSame = 1e-4;
    constexpr std::size_t kMostDirections = 13;  // of a lattice of cells around one
    for (const Pair& pair : pairs_) {
      const double size = std::max({std::abs(pair.shift[0]), std::abs(pair.shift[1]), std::abs(pair.shift[2])});
      const auto same = std::find_if(shifts.begin(), shifts.end(), [&](const Place& shift) {
        for (std::size_t k = 0; k < 3; ++k)
          if (std::abs(shift[k] - pair.shift[k]) > kSame * size) return false;
        return true;
      });
      groups[std::size_t(same - shifts.begin())].push_back(&pair);
      if (same == shifts.end()) shifts.push_back(pair.shift);
    }
    if (groups.size() <= kMostDirections) return groups;
    groups.clear();
    for (const Pair& pair : pairs_) groups[0].push_back(&pair);
    return groups;
  }

  bool shifts_alike(const std::vector<const Pair*>& pairs) const {
    const Place& first = pairs.front()->shift;
    return std::all_of(pairs.begin(), pairs.end(), [&](const Pair* pair) {
      for (std::size_t k = 0; k < 3; ++k)
        if (!is_one_place(first[k], pair->shift[k], std::abs(first[k]))) return false;
      return true;
    });
  }

  void add_link(std::size_t number, const std::vector<const Pair*>& pairs) {
    const int first = add_sides(number, pairs, &Pair::first, "first"),
              second = add_sides(number, pairs, &Pair::second, "second");
    PeriodicLink link{mesh_.dimension - 1, second, first, {}, {}};
    if (shifts_alike(pairs)) {
      const Place& shift = pairs.front()->shift;
      link.affine = {1, 0, 0, shift[0], 0, 1, 0, shift[1], 0, 0, 1, shift[2], 0, 0, 0, 1};
    }
    std::map<std::int32_t, std::int32_t> nodes;
    for (const Pair* pair : pairs) {
      const auto masters = side_nodes(pair->first), images = side_nodes(pair->second);
      reading_.scanner.take_memory(masters.size() * (kTreeNode + sizeof(link.nodes[0])));
      for (const auto& [node, image] : images) nodes[image] = masters.at(node);
    }
    link.nodes.assign(nodes.begin(), nodes.end());
    mesh_.periodic.push_back(std::move(link));
  }

  /// The copies of the nodes of a side, by their numbers in the file. The blocks have the copies now.
  std::map<std::int32_t, std::int32_t> side_nodes(const CutSide& side) const {
    const ElementBlock& block = mesh_.blocks[side.block];
    std::map<std::int32_t, std::int32_t> nodes;
    for (const int local : reference::facet_nodes(block.shape, mesh_.order, side.facet)) {
      const std::size_t at = side.element * stride(block) + std::size_t(local);
      nodes[own_[side.block][at]] = block.nodes[at];
    }
    return nodes;
  }

  /// Adds the sides as boundary elements of a new group, and returns its tag.
  int add_sides(std::size_t link, const std::vector<const Pair*>& pairs, CutSide Pair::*which, const char* name) {
    int tag = 1;
    std::int64_t number = 0;
    for (const ElementBlock& block : mesh_.blocks) {
      if (reference::info(block.shape).dimension == mesh_.dimension - 1) tag = std::max(tag, block.entity + 1);
      if (!block.numbers.empty()) number = std::max(number, block.numbers.back());
    }
    for (const PhysicalGroup& group : mesh_.physical_groups) tag = std::max(tag, group.tag + 1);
    const std::size_t before = mesh_.blocks.size();
    for (const Pair* pair : pairs) {
      const CutSide& side = pair->*which;
      const Shape shape = mesh_.blocks[side.block].shape;
      const Shape own = reference::info(shape).facets[std::size_t(side.facet)].shape;
      if (mesh_.blocks.size() == before || mesh_.blocks.back().shape != own)
        reading_.scanner.add(mesh_.blocks, ElementBlock{own, mesh_.order, tag, {tag}, {}, {}, {}, {}});
      const std::int32_t* nodes =
          mesh_.blocks[side.block].nodes.data() + side.element * stride(mesh_.blocks[side.block]);
      ElementBlock& block = mesh_.blocks.back();
      reading_.scanner.add(block.numbers, ++number);
      for (const int local : reference::facet_nodes(shape, mesh_.order, side.facet))
        reading_.scanner.add(block.nodes, nodes[local]);
    }
    mesh_.physical_groups.push_back({mesh_.dimension - 1, tag, "periodic_" + std::to_string(link) + "_" + name});
    return tag;
  }

  MfemReading& reading_;
  HighOrderMesh& mesh_;
  const std::vector<double>& places_;
  std::vector<std::int32_t> next_;  ///< The next copy of a node; −1: none.
  std::vector<bool> placed_;
  std::vector<std::vector<std::int32_t>> own_;  ///< The nodes of each block of cells, as copies.
  std::vector<Pair> pairs_;
};

}  // namespace

void cut_open(MfemReading& reading, const std::vector<double>& places) { Cutting(reading, places).apply(); }

}  // namespace varimesh::formats
