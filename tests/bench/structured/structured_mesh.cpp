// Every node of a block lies on a lattice with order × cells + 1 positions per direction. Kuhn's tetrahedra have their
// nodes on this lattice too. So the surface of the cube is numbered once, and a node is its number there and its layer.
#include "tests/bench/structured/structured_mesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "tests/bench/structured/blocks.h"
#include "tests/bench/structured/cell_nodes.h"
#include "tests/bench/structured/random_shift.h"

namespace varimesh::bench {
namespace {

constexpr double kGrading = 2.0;            // the last step from the sphere to the cube, over the first
constexpr double kRadialShare = 2.0 / 3.0;  // m / n, at which cells are about as high as wide
constexpr std::array<Steps, 6> kSplits{{{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}}};

/// Makes one mesh.
class Maker {
 public:
  Maker(const StructuredMesh& wanted, BlockCounts counts) : wanted_(wanted), counts_(counts) {}

  HighOrderMesh make() {
    place_vertices();
    shift_vertices();
    place_nodes();
    add_cells();
    add_faces(0, "sphere");
    add_faces(counts_.radial, "cube");
    return std::move(mesh_);
  }

 private:
  std::int64_t vertex(const Block& block, int i, int j, int k) const {
    return k * coarse_.count() + coarse_.number(block.on_cube(i, j, counts_.along));
  }
  std::int64_t node(const Block& block, const Steps& at) const {
    return at[2] * fine_.count() + fine_.number(block.on_cube(at[0], at[1], fine_.n));
  }
  /// Calls visit(i, j, k) for every hexahedron of a block.
  template <class Visit>
  void each_hexahedron(const Visit& visit) const;
  Corners corners_of(const Block& block, int i, int j, int k) const;

  void place_vertices();
  /// The length of the shortest edge at each vertex.
  std::vector<double> shortest_edges() const;
  void shift_vertices();
  void place_nodes();
  void shift_node(Point& point, std::int64_t number, const Steps& local, const Corners& corners) const;
  void add_cells();
  /// The triangles or quadrilaterals on layer k of the vertices.
  void add_faces(int k, const char* name);
  void add_element(const Block& block, ElementBlock& to, const Steps& corner, const std::vector<Steps>& offsets);

  StructuredMesh wanted_;
  BlockCounts counts_;
  Surface coarse_{counts_.along};
  Surface fine_{counts_.along * wanted_.order};
  std::vector<Point> vertices_;
  HighOrderMesh mesh_;
  std::int64_t elements_ = 0;
};

template <class Visit>
void Maker::each_hexahedron(const Visit& visit) const {
  for (int k = 0; k < counts_.radial; ++k)
    for (int j = 0; j < counts_.along; ++j)
      for (int i = 0; i < counts_.along; ++i) visit(i, j, k);
}

Corners Maker::corners_of(const Block& block, int i, int j, int k) const {
  Corners corners;
  corners.on_sphere = k == 0;
  for (int c = 0; c < 8; ++c)
    corners.at[std::size_t(c)] = vertices_[std::size_t(vertex(block, i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)))];
  return corners;
}

void Maker::place_vertices() {
  const int n = counts_.along, m = counts_.radial;
  vertices_.resize(std::size_t(coarse_.count() * (m + 1)));
  // 0 at the sphere, 1 at the cube; each step is `quotient` times the one before.
  std::vector<double> outwards{0};
  const double quotient = m > 1 ? std::pow(kGrading, 1.0 / (m - 1)) : 1;
  for (double step = 1; int(outwards.size()) <= m; step *= quotient) outwards.push_back(outwards.back() + step);
  for (double& one : outwards) one /= outwards.back();
  outwards.back() = 1;
  for (const Block& block : kBlocks)
    for (int j = 0; j <= n; ++j)
      for (int i = 0; i <= n; ++i) {
        Point cube{}, sphere{};
        const Steps at = block.on_cube(i, j, n);
        for (std::size_t k = 0; k < 3; ++k) {
          cube[k] = 2.0 * at[k] / n - 1;
          // Nearly tan(π x / 4), which would make equal angles.
          constexpr double kSlope = 0.785;
          sphere[k] = cube[k] * (kSlope + (1 - kSlope) * cube[k] * cube[k]);
        }
        const double scale = kRadius / length(sphere);
        for (int layer = 0; layer <= m; ++layer) {
          const double t = outwards[std::size_t(layer)];
          Point& to = vertices_[std::size_t(vertex(block, i, j, layer))];
          for (std::size_t k = 0; k < 3; ++k) to[k] = (1 - t) * scale * sphere[k] + t * cube[k];
        }
      }
}

std::vector<double> Maker::shortest_edges() const {
  std::vector<double> shortest(vertices_.size(), std::numeric_limits<double>::max());
  const auto edge = [&](std::int64_t a, std::int64_t b) {
    const double long_as = distance(vertices_[std::size_t(a)], vertices_[std::size_t(b)]);
    for (const std::int64_t end : {a, b}) shortest[std::size_t(end)] = std::min(shortest[std::size_t(end)], long_as);
  };
  const int n = counts_.along;
  for (const Block& block : kBlocks)
    for (int k = 0; k <= counts_.radial; ++k)
      for (int j = 0; j <= n; ++j)
        for (int i = 0; i <= n; ++i) {
          const std::int64_t from = vertex(block, i, j, k);
          if (i < n) edge(from, vertex(block, i + 1, j, k));
          if (j < n) edge(from, vertex(block, i, j + 1, k));
          if (k < counts_.radial) edge(from, vertex(block, i, j, k + 1));
        }
  return shortest;
}

void Maker::shift_vertices() {
  const std::vector<double> shortest = shortest_edges();
  const auto free_end = std::size_t(counts_.radial * coarse_.count());
  for (auto at = std::size_t(coarse_.count()); at < free_end; ++at)
    shift(vertices_[at], at, wanted_.vertex_shift * shortest[at]);
}

void Maker::shift_node(Point& point, std::int64_t number, const Steps& local, const Corners& corners) const {
  const bool is_vertex = std::all_of(local.begin(), local.end(), [&](int x) { return x % wanted_.order == 0; });
  const std::int64_t layer = number / fine_.count();
  if (wanted_.node_shift == 0 || is_vertex || layer == 0 || layer == std::int64_t{wanted_.order} * counts_.radial)
    return;
  double shortest = std::numeric_limits<double>::max();
  for (std::size_t c = 0; c < 8; ++c)
    for (std::size_t axis = 1; axis < 8; axis *= 2)
      if ((c & axis) == 0) shortest = std::min(shortest, distance(corners.at[c], corners.at[c | axis]));
  // Keys above those of the vertices.
  shift(point, vertices_.size() + std::uint64_t(number), wanted_.node_shift * shortest / wanted_.order);
}

void Maker::place_nodes() {
  const int p = wanted_.order;
  const std::int64_t count = fine_.count() * (std::int64_t{counts_.radial} * p + 1);
  mesh_.coordinates.resize(3 * std::size_t(count));
  mesh_.node_numbers.resize(std::size_t(count));
  std::iota(mesh_.node_numbers.begin(), mesh_.node_numbers.end(), 1);
  mesh_.node_blocks.push_back({-1, 0, 0, std::int32_t(count)});
  for (const Block& block : kBlocks)
    each_hexahedron([&](int i, int j, int k) {
      const Corners corners = corners_of(block, i, j, k);
      Steps local{};
      // Positions between two cells are placed by both, at the same point to rounding; the last one counts.
      for (local[2] = 0; local[2] <= p; ++local[2])
        for (local[1] = 0; local[1] <= p; ++local[1])
          for (local[0] = 0; local[0] <= p; ++local[0]) {
            const std::int64_t number = node(block, {i * p + local[0], j * p + local[1], k * p + local[2]});
            Point point = node_in_cell(wanted_.shape, corners, local, p);
            shift_node(point, number, local, corners);
            std::copy(point.begin(), point.end(), mesh_.coordinates.begin() + 3 * number);
          }
    });
}

void Maker::add_element(const Block& block, ElementBlock& to, const Steps& corner, const std::vector<Steps>& offsets) {
  to.numbers.push_back(++elements_);
  for (const Steps& offset : offsets)
    to.nodes.push_back(
        std::int32_t(node(block, {corner[0] + offset[0], corner[1] + offset[1], corner[2] + offset[2]})));
}

void Maker::add_cells() {
  const int p = wanted_.order;
  ElementBlock cells;
  cells.shape = wanted_.shape;
  cells.order = p;
  cells.entity = 1;
  cells.physical = {1};
  const std::size_t hexahedra =
      std::size_t(6) * std::size_t(counts_.along) * std::size_t(counts_.along) * std::size_t(counts_.radial);
  const std::size_t count = hexahedra * (wanted_.shape == Shape::Hexahedron ? 1 : kSplits.size());
  cells.numbers.reserve(count);
  cells.nodes.reserve(count * std::size_t(reference::node_count(wanted_.shape, p)));
  for (const Block& block : kBlocks) {
    std::vector<std::vector<Steps>> patterns;
    if (wanted_.shape == Shape::Hexahedron) {
      patterns.push_back(tensor_nodes(wanted_.shape, !block.right_handed(), p));
    } else {
      // The first three splits are even permutations of the axes.
      for (std::size_t s = 0; s < kSplits.size(); ++s)
        patterns.push_back(simplex_nodes(wanted_.shape, kSplits[s], (s < 3) != block.right_handed(), p));
    }
    each_hexahedron([&](int i, int j, int k) {
      for (const auto& pattern : patterns) add_element(block, cells, {i * p, j * p, k * p}, pattern);
    });
  }
  mesh_.dimension = 3;
  mesh_.order = p;
  mesh_.blocks.push_back(std::move(cells));
  mesh_.physical_groups.push_back({3, 1, "solid"});
}

void Maker::add_faces(int k, const char* name) {
  const int p = wanted_.order, tag = int(mesh_.physical_groups.size());
  const bool simplices = wanted_.shape == Shape::Tetrahedron;
  ElementBlock faces;
  faces.shape = simplices ? Shape::Triangle : Shape::Quadrilateral;
  faces.order = p;
  faces.entity = tag;
  faces.physical = {tag};
  for (const Block& block : kBlocks) {
    // Counter-clockwise seen from outside the solid: at the cube r leads outwards, at the sphere inwards.
    const bool mirrored = block.right_handed() != (k > 0);
    std::vector<std::vector<Steps>> patterns;
    if (simplices)
      patterns = {simplex_nodes(faces.shape, {0, 1, 2}, mirrored, p),
                  simplex_nodes(faces.shape, {1, 0, 2}, !mirrored, p)};
    else
      patterns = {tensor_nodes(faces.shape, mirrored, p)};
    for (int j = 0; j < counts_.along; ++j)
      for (int i = 0; i < counts_.along; ++i)
        for (const auto& pattern : patterns) add_element(block, faces, {i * p, j * p, k * p}, pattern);
  }
  mesh_.blocks.push_back(std::move(faces));
  mesh_.physical_groups.push_back({2, tag, name});
}

}  // namespace

BlockCounts block_counts(std::int64_t elements, int cells_each) {
  BlockCounts best{1, 1};
  double least = std::numeric_limits<double>::max();
  const double hexahedra = static_cast<double>(elements) / (6.0 * cells_each);
  const int likely = std::max(1, int(std::cbrt(hexahedra / kRadialShare)));
  for (int n = std::max(1, likely - 3); n <= likely + 3; ++n) {
    const int rounded = std::max(1, int(std::lround(hexahedra / (double(n) * n))));
    const double wrong_count = std::abs(std::log(double(n) * n * rounded / hexahedra));
    const double wrong_shape = std::abs(std::log(rounded / (kRadialShare * n)));
    if (wrong_count + wrong_shape / 2 >= least) continue;
    least = wrong_count + wrong_shape / 2;
    best = {n, rounded};
  }
  return best;
}

Expected<HighOrderMesh> cube_with_hole(const StructuredMesh& wanted) {
  if (wanted.shape != Shape::Tetrahedron && wanted.shape != Shape::Hexahedron)
    return bad_option("a cube with a hole is made of tetrahedra or hexahedra");
  if (wanted.order < 1 || wanted.order > kMaxOrder)
    return bad_option("the order must be 1 to " + std::to_string(kMaxOrder));
  const double nodes_per_element = std::pow(wanted.order, 3) / (wanted.shape == Shape::Hexahedron ? 1 : 6);
  // Some more nodes than this lie on the boundary.
  const double most = 0.8 * std::numeric_limits<std::int32_t>::max() / std::max(1.0, nodes_per_element);
  if (wanted.elements < 6 || static_cast<double>(wanted.elements) > most)
    return bad_option("the number of elements must be 6 to " + std::to_string(std::int64_t(most)));
  return Maker(wanted, block_counts(wanted.elements, wanted.shape == Shape::Hexahedron ? 1 : int(kSplits.size())))
      .make();
}

Expected<HighOrderMesh> perturbed_square(int cells, double most) {
  if (cells < 1 || cells > 20'000) return bad_option("a square has 1 to 20000 cells per side");
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  ElementBlock squares;
  squares.shape = Shape::Quadrilateral;
  squares.entity = 1;
  const int side = cells + 1;
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      const int number = side * j + i;
      Point point{double(i), double(j), 0};
      if (i > 0 && i < cells && j > 0 && j < cells) shift(point, std::uint64_t(number), most);
      for (const double x : {point[0] / cells, point[1] / cells, 0.0}) mesh.coordinates.push_back(x);
      mesh.node_numbers.push_back(number + 1);
      if (i == cells || j == cells) continue;
      squares.numbers.push_back(std::int64_t(squares.numbers.size()) + 1);
      squares.nodes.insert(squares.nodes.end(), {number, number + 1, number + side + 1, number + side});
    }
  mesh.node_blocks.push_back({-1, 0, 0, side * side});
  mesh.blocks.push_back(std::move(squares));
  return mesh;
}

}  // namespace varimesh::bench
