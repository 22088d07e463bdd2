// The checks, in order of cost. Each reports its first fault and counts the faults of the same kind.
#include "core/mesh/check.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>

#include "core/base/shared_work.h"
#include "core/base/stopwatch.h"
#include "core/mesh/bounding_box.h"
#include "core/mesh/checked_mesh.h"
#include "core/mesh/conformity.h"
#include "core/mesh/connectivity.h"

namespace varimesh {

namespace {

// Of the diagonal: how far nodes may be beside a plane. Coordinates that passed through single precision, or through a
// file with seven digits, are up to 10⁻⁷ off.
constexpr double kFlatness = 1e-6;
constexpr std::size_t kNodesPerTask = 16384, kCellsPerTask = 2048, kIndicesPerTask = 65536;

std::string name_of(Shape shape) { return std::string(reference::info(shape).name); }

// " (12 such elements in all)" if there are more than the one that the sentence names.
std::string and_more(std::size_t count, const char* things) {
  return count > 1 ? " (" + std::to_string(count) + " such " + things + " in all)" : "";
}

// === Arrays that fit together ============================================================================
// A file's reader ensures this. A mesh that is given as data may be wrong.

Expected<void> check_blocks(const HighOrderMesh& mesh, const Team& team) {
  const auto nodes = std::int64_t(mesh.node_count());
  for (const ElementBlock& block : mesh.blocks) {
    const std::string where = "A block of " + std::string(reference::info(block.shape).plural) + " on entity " +
                              std::to_string(block.entity) + " has ";
    const int largest = block.shape == Shape::Point ? 1 : kMaxOrder;
    if (block.order < 1 || block.order > largest)
      return bad_input(where + "order " + std::to_string(block.order) + "; possible orders are 1 to 10.");
    const auto stride = std::size_t(reference::node_count(block.shape, block.order));
    if (block.nodes.size() != block.size() * stride)
      return bad_input(where + std::to_string(block.nodes.size()) + " nodes for " + std::to_string(block.size()) +
                       " elements; each needs " + std::to_string(stride) + ".");
    const std::size_t k = first_of(team, block.nodes.size(), kIndicesPerTask,
                                   [&](std::size_t i) { return block.nodes[i] < 0 || block.nodes[i] >= nodes; });
    if (k < block.nodes.size())
      return bad_input("Element " + std::to_string(block.numbers[k / stride]) + " refers to node index " +
                       std::to_string(block.nodes[k]) + ", but the mesh has " + std::to_string(nodes) + " nodes.");
  }
  return {};
}

/// New nodes and elements get the numbers above the largest one, so numbers stay far enough below 2^63.
constexpr std::int64_t kLargestNumber = std::int64_t{1} << 62;

Expected<void> check_numbers(const char* what, const std::vector<std::int64_t>& numbers, const Team& team) {
  const auto is_beyond = [&](std::size_t i) { return numbers[i] > kLargestNumber || numbers[i] < -kLargestNumber; };
  const std::size_t first = first_of(team, numbers.size(), kNodesPerTask, is_beyond);
  if (first == numbers.size()) return {};
  return bad_input(std::string(what) + " " + std::to_string(numbers[first]) +
                   " has a number beyond 2^62, which leaves too few numbers for new ones; number the mesh anew.");
}

Expected<void> check_arrays(const HighOrderMesh& mesh, const Team& team) {
  if (mesh.coordinates.size() % 3 != 0)
    return bad_input("The mesh does not have three coordinates per node; give x, y and z for each.");
  if (mesh.node_numbers.size() != mesh.node_count())
    return bad_input("The mesh has " + std::to_string(mesh.node_count()) + " nodes and " +
                     std::to_string(mesh.node_numbers.size()) + " node numbers; give one number per node.");
  if (auto done = check_numbers("Node", mesh.node_numbers, team); !done) return done;
  for (const ElementBlock& block : mesh.blocks)
    if (auto done = check_numbers("Element", block.numbers, team); !done) return done;
  return check_blocks(mesh, team);
}

// === What kind of mesh ===================================================================================

Expected<void> check_kind(const HighOrderMesh& mesh, const Team&) {
  if (mesh.blocks.empty() || mesh.node_count() == 0)
    return bad_input(
        "The mesh is empty: it has no elements. In Gmsh, set Mesh.SaveAll=1 or make sure that physical groups cover "
        "the cells.");
  int dimension = 0;
  for (const ElementBlock& block : mesh.blocks)
    if (block.size() > 0) dimension = std::max(dimension, reference::info(block.shape).dimension);
  if (dimension < 2)
    return bad_input("The mesh has dimension " + std::to_string(dimension) +
                     ": it contains only points and lines. Save its surface or volume elements too.");
  if (dimension != mesh.dimension)
    return bad_input("The mesh claims to have dimension " + std::to_string(mesh.dimension) +
                     ", but its elements have dimension " + std::to_string(dimension) + "; correct its dimension.");
  for (const ElementBlock& block : mesh.blocks) {
    const int d = reference::info(block.shape).dimension;
    if (block.size() == 0 || d < dimension - 1 || block.order == mesh.order || block.shape == Shape::Point) continue;
    return bad_input("Orders are mixed: element " + std::to_string(block.numbers.front()) + " (" +
                     name_of(block.shape) + ") has order " + std::to_string(block.order) +
                     ", but the cells have order " + std::to_string(mesh.order) +
                     ". Write the mesh with one order, in Gmsh with -order " + std::to_string(mesh.order) + ".");
  }
  return {};
}

// === Coordinates =========================================================================================

/// The square of the volume of a cell of this size is still a finite number.
constexpr double kLargestCoordinate = 1e50;

/// Refuses the nodes that have a coordinate for which `is_bad`. The sentence is "Node N has a coordinate that " +
/// `what`.
template <class IsBad>
Expected<void> refuse_nodes(const HighOrderMesh& mesh, const Team& team, const IsBad& is_bad, const std::string& what,
                            const std::string& remedy) {
  const auto is_bad_node = [&](std::size_t node) {
    const double* x = mesh.coordinates.data() + 3 * node;
    return is_bad(x[0]) || is_bad(x[1]) || is_bad(x[2]);
  };
  const std::size_t first = first_of(team, mesh.node_count(), kNodesPerTask, is_bad_node);
  if (first == mesh.node_count()) return {};
  std::size_t count = 0;
  for (std::size_t i = first; i < mesh.node_count(); ++i) count += is_bad_node(i) ? 1 : 0;
  return bad_input("Node " + std::to_string(mesh.node_numbers[first]) + " has a coordinate that " + what +
                   and_more(count, "nodes") + remedy);
}

Expected<void> check_coordinates(const HighOrderMesh& mesh, const Team& team) {
  const auto finite = refuse_nodes(
      mesh, team, [](double x) { return !std::isfinite(x); }, "is not a finite number", "; write the mesh again.");
  if (!finite) return finite;
  return refuse_nodes(
      mesh, team, [](double x) { return std::abs(x) > kLargestCoordinate; }, "is beyond 1e50",
      ", and volumes of such cells cannot be computed; correct it, or write the mesh in a larger unit of length.");
}

// A 2-D mesh must lie in a plane z = constant.
Expected<void> check_plane(const HighOrderMesh& mesh, const Team& team) {
  if (!is_surface(mesh, team)) return {};
  const auto [low, high] = bounding_box(mesh, team);
  return bad_input(
      "The mesh is a surface in space: it has no volume elements, and z ranges from " + std::to_string(low[2]) +
      " to " + std::to_string(high[2]) +
      ". Its nodes cannot move along it without its CAD model; give the model as the geometry, or save the volume "
      "elements too. Without either, only the quality of the mesh can be judged.");
}

// === Single cells ========================================================================================

// Finds nodes that an element has twice. The table is a quarter full, so most nodes are found or entered at once.
class NodeTable {
 public:
  explicit NodeTable(std::size_t nodes) : slots_(std::bit_ceil(4 * nodes), -1) {}

  // The position of the first node that occurs for the second time; `count` if all are distinct.
  std::size_t first_repeated(const std::int32_t* nodes, std::size_t count) {
    std::fill(slots_.begin(), slots_.end(), -1);
    for (std::size_t k = 0; k < count; ++k) {
      // Neighbouring numbers go to slots that are far apart (D. Knuth, The Art of Computer Programming 3, section 6.4).
      std::size_t slot = std::uint32_t(nodes[k]) * 2654435769u;
      for (slot >>= 8;; ++slot) {
        std::int32_t& at = slots_[slot & (slots_.size() - 1)];
        if (at == nodes[k]) return k;
        if (at >= 0) continue;
        at = nodes[k];
        break;
      }
    }
    return count;
  }

 private:
  std::vector<std::int32_t> slots_;
};

Expected<void> check_distinct_nodes(const HighOrderMesh& mesh, const Team& team) {
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension < mesh.dimension - 1) continue;
    const auto stride = std::size_t(reference::node_count(block.shape, block.order));
    const std::size_t tasks = chunks_of(block.size(), kCellsPerTask);
    std::vector<std::size_t> first(tasks, block.size());  // the first fault of each chunk
    for_chunks(team, block.size(), kCellsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
      NodeTable table(stride);
      for (std::size_t e = begin; e < end && first[chunk] == block.size(); ++e)
        if (table.first_repeated(block.nodes.data() + e * stride, stride) < stride) first[chunk] = e;
    });
    const auto fault = std::find_if(first.begin(), first.end(), [&](std::size_t e) { return e < block.size(); });
    if (fault == first.end()) continue;
    const std::int32_t* nodes = block.nodes.data() + *fault * stride;
    const std::int32_t node = nodes[NodeTable(stride).first_repeated(nodes, stride)];
    return bad_input("Element " + std::to_string(block.numbers[*fault]) + " (" + name_of(block.shape) + ") has node " +
                     std::to_string(mesh.node_numbers[std::size_t(node)]) +
                     " twice; write the mesh without degenerate elements.");
  }
  return {};
}

// === Duplicates ==========================================================================================

Expected<void> check_duplicates(const HighOrderMesh& mesh, const Team& team) {
  const Cells cells(mesh, mesh.dimension);
  // Two cells with the same vertices may be different ones: the halves of a ring share all four.
  const auto sorted_nodes = [&](std::size_t cell) {
    const auto nodes = cells.nodes(cell);
    std::vector<std::int32_t> sorted(nodes.begin(), nodes.end());
    std::sort(sorted.begin(), sorted.end());
    return sorted;
  };
  std::vector<std::pair<std::uint64_t, std::int32_t>> hashes(cells.count());
  for (const Cells::Range& range : cells.ranges())
    team.for_ranges(range.block->size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        // A sum of well-mixed vertex numbers, so that the order of the vertices does not matter.
        std::uint64_t hash = 0;
        for (std::size_t k = 0; k < std::size_t(reference::info(range.block->shape).vertices); ++k) {
          std::uint64_t x = std::uint64_t(range.block->nodes[e * range.stride + k]) + 0x9e3779b97f4a7c15u;
          x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;  // splitmix64
          x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
          hash += x ^ (x >> 31);
        }
        hashes[range.first + e] = {hash, std::int32_t(range.first + e)};
      }
    });
  sort_distinct(team, hashes);
  std::int32_t first = -1, twin = -1;
  std::size_t count = 0;
  for (std::size_t i = 1; i < hashes.size(); ++i) {
    if (hashes[i].first != hashes[i - 1].first) continue;
    const auto [a, b] = std::pair(hashes[i - 1].second, hashes[i].second);
    if (sorted_nodes(std::size_t(a)) != sorted_nodes(std::size_t(b))) continue;
    if (count++ == 0 || a < first) first = a, twin = b;
  }
  if (count == 0) return {};
  return bad_input("Elements " + std::to_string(cells.number(std::size_t(first))) + " and " +
                   std::to_string(cells.number(std::size_t(twin))) + " are the same " +
                   name_of(cells.shape(std::size_t(first))) + and_more(count, "pairs") + "; remove the duplicates.");
}

}  // namespace

Expected<void> check_counts(std::int64_t nodes, std::int64_t cells) {
  const auto refuse = [](std::int64_t count, const char* things, std::int64_t most) {
    return bad_input("The mesh has " + std::to_string(count) + " " + things + ", but can have at most " +
                     std::to_string(most) + "; divide it into parts, or use larger elements.");
  };
  if (nodes > kMostNodes) return refuse(nodes, "nodes", kMostNodes);
  if (cells > kMostCells) return refuse(cells, "cells", kMostCells);
  return {};
}

Expected<void> check_structure(const HighOrderMesh& mesh, const Team& team, Facets* found) {
  if (auto done = check_counts(static_cast<std::int64_t>(mesh.node_count()),
                               static_cast<std::int64_t>(mesh.element_count(mesh.dimension)));
      !done)
    return done;
  for (auto step : {check_kind, check_arrays, check_coordinates, check_plane, check_distinct_nodes, check_duplicates})
    if (auto done = step(mesh, team); !done) return tl::unexpected<Error>(done.error());
  Facets facet = facets(mesh, team);
  if (auto done = check_conformity(mesh, facet, team); !done) return tl::unexpected<Error>(done.error());
  if (found != nullptr) *found = std::move(facet);
  return {};
}

Expected<void> check_places(const HighOrderMesh& mesh, const Team& team) {
  if (auto done = check_coordinates(mesh, team); !done) return done;
  return check_plane(mesh, team);
}

Expected<void> check_part(const HighOrderMesh& part, const Team& team) {
  for (auto step : {check_kind, check_arrays, check_coordinates, check_distinct_nodes})
    if (auto done = step(part, team); !done) return done;
  return {};
}

Expected<void> check_together(const HighOrderMesh& mesh, const Facets& facets, const Team& team) {
  for (auto step : {check_plane, check_duplicates})
    if (auto done = step(mesh, team); !done) return done;
  return check_conformity(mesh, facets, team);
}

namespace {

/// Puts a plane mesh in space into its plane.
std::optional<Plane> flattened(HighOrderMesh& mesh, const Team& team) {
  if (mesh.dimension != 2) return std::nullopt;
  for (auto step : {check_kind, check_arrays, check_coordinates})
    if (!step(mesh, team)) return std::nullopt;
  std::optional<Plane> plane = Plane::of(mesh, team);
  if (plane) plane->flatten(mesh);
  return plane;
}

}  // namespace

Expected<CheckedMesh> check_mesh(HighOrderMesh mesh, CheckFor purpose, const Team& team) {
  const Stopwatch watch;
  CheckedMesh result{std::move(mesh), {}};
  Expected<void> done;
  team.run([&] {
    if (purpose == CheckFor::Optimising) result.plane = flattened(result.mesh, team);
    done = purpose == CheckFor::Judging ? check_judgeable(result.mesh, team, &result.facets)
                                        : check_structure(result.mesh, team, &result.facets);
  });
  if (!done) return tl::unexpected(done.error());
  result.seconds = watch.seconds();
  return result;
}

bool lies_flat(const HighOrderMesh& mesh, const Team& team) { return lies_flat(bounding_box(mesh, team)); }

bool lies_flat(const BoundingBox& box) {
  const auto& [low, high] = box;
  const double diagonal = std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  return high[2] - low[2] <= kFlatness * diagonal;
}

bool is_surface(const HighOrderMesh& mesh, const Team& team) { return mesh.dimension == 2 && !lies_flat(mesh, team); }

Expected<void> check_judgeable(const HighOrderMesh& mesh, const Team& team, Facets* found) {
  if (mesh.dimension != 2) return check_structure(mesh, team, found);
  // Only a mesh that has passed these has coordinates by which to tell.
  for (auto step : {check_kind, check_arrays, check_coordinates})
    if (auto done = step(mesh, team); !done) return tl::unexpected<Error>(done.error());
  if (!is_surface(mesh, team)) return check_structure(mesh, team, found);
  // Each cell is judged with nodes of its own.
  const Cells cells(mesh, mesh.dimension);
  std::int64_t nodes = 0;
  for (const Cells::Range& range : cells.ranges()) nodes += std::int64_t(range.block->nodes.size());
  if (auto done = check_counts(nodes, std::int64_t(cells.count())); !done) return done;
  for (auto step : {check_distinct_nodes, check_duplicates})
    if (auto done = step(mesh, team); !done) return tl::unexpected<Error>(done.error());
  return {};
}

Expected<void> check_blocks(const HighOrderMesh& mesh) { return check_blocks(mesh, Team(1)); }

Expected<void> check_structure(const HighOrderMesh& mesh) { return check_structure(mesh, Team(1)); }

bool is_surface(const HighOrderMesh& mesh) { return is_surface(mesh, Team(1)); }

Expected<void> check_judgeable(const HighOrderMesh& mesh) { return check_judgeable(mesh, Team(1)); }

}  // namespace varimesh
