#include "core/device_kernels/self_check.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <string>
#include <vector>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cells_on_device.h"
#include "core/mesh/changes/change_order.h"
#include "core/mesh/connectivity.h"
#include "core/problem/node_conversion.h"
#include "core/problem/problem.h"

namespace varimesh::device {
namespace {

HighOrderMesh empty_mesh(int dimension, Shape shape) {
  HighOrderMesh mesh;
  mesh.dimension = dimension;
  mesh.order = 1;
  ElementBlock& block = mesh.blocks.emplace_back();
  block.shape = shape;
  block.entity = 1;
  return mesh;
}

void add_node(HighOrderMesh& mesh, std::initializer_list<int> at) {
  mesh.coordinates.insert(mesh.coordinates.end(), at.begin(), at.end());
  mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
}

/// The mesh in another order, with its nodes moved a little.
HighOrderMesh bent(HighOrderMesh mesh, int order) {
  mesh.node_blocks = {{mesh.dimension, 1, 0, static_cast<std::int32_t>(mesh.node_count())}};
  HighOrderMesh curved = *change_order(mesh, order);
  for (std::size_t i = 0; i < curved.coordinates.size(); ++i)
    if (mesh.dimension == 3 || i % 3 != 2)
      curved.coordinates[i] += 0.05 / (order * order) * std::sin(static_cast<double>(5 * i + 1));
  return curved;
}

/// How a square or a cube is cut into cells of a shape: corners by bits, 1 the next x, 2 the next y, 4 the next z.
struct Cut {
  int dimension;
  Shape shape;
  std::vector<std::vector<int>> cells;
};

const Cut kTriangles{2, Shape::Triangle, {{0, 1, 3}, {0, 3, 2}}};
const Cut kQuadrilaterals{2, Shape::Quadrilateral, {{0, 1, 3, 2}}};
const Cut kTetrahedra{
    3, Shape::Tetrahedron, {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}}};
const Cut kPrisms{3, Shape::Prism, {{0, 1, 3, 4, 5, 7}, {0, 3, 2, 4, 7, 6}}};
const Cut kHexahedra{3, Shape::Hexahedron, {{0, 1, 3, 2, 4, 5, 7, 6}}};

/// A grid of squares or cubes, cut into cells: three squares or two cubes in each direction.
HighOrderMesh grid(const Cut& cut, int order) {
  HighOrderMesh mesh = empty_mesh(cut.dimension, cut.shape);
  const int side = cut.dimension == 2 ? 3 : 2, sides_up = cut.dimension == 2 ? 1 : side;
  const int points = side + 1, points_up = cut.dimension == 2 ? 1 : points;
  for (int z = 0; z < points_up; ++z)
    for (int y = 0; y < points; ++y)
      for (int x = 0; x < points; ++x) add_node(mesh, {x, y, z});
  ElementBlock& block = mesh.blocks.front();
  for (int cube = 0; cube < side * side * sides_up; ++cube)
    for (const std::vector<int>& cell : cut.cells) {
      block.numbers.push_back(static_cast<std::int64_t>(block.numbers.size()) + 1);
      for (const int bits : cell) {
        const int x = cube % side + bits % 2, y = cube / side % side + bits / 2 % 2, z = cube / side / side + bits / 4;
        block.nodes.push_back((z * points + y) * points + x);
      }
    }
  return bent(std::move(mesh), order);
}

/// All numbers that the kernels compute of a problem, as bytes.
Possible<std::vector<char>> results(Device& device, const Problem& problem, const Material& material) {
  const auto cells = CellsOnDevice::make(device, problem, material);
  if (!cells) return tl::unexpected(cells.error());
  std::vector<char> bytes;
  const auto add = [&](const auto* numbers, std::size_t count) {
    const auto* first = reinterpret_cast<const char*>(numbers);
    bytes.insert(bytes.end(), first, first + count * sizeof *numbers);
  };
  const auto scans = (*cells)->scan();
  if (!scans) return tl::unexpected(scans.error());
  add(scans->data(), scans->size());
  const std::size_t unknowns = problem.free.size() * static_cast<std::size_t>(problem.dimension);
  std::vector<double> gradient(unknowns);
  for (const auto run : {&CellsOnDevice::gradient, &CellsOnDevice::linearise}) {
    if (const auto done = (**cells.*run)(gradient); !done) return tl::unexpected(done.error());
    add(gradient.data(), unknowns);
  }
  std::vector<float> direction(gradient.begin(), gradient.end()), product(unknowns);
  const auto along = (*cells)->multiply(direction, product);
  if (!along) return tl::unexpected(along.error());
  add(product.data(), unknowns);
  add(&*along, 1);
  return bytes;
}

}  // namespace

std::vector<HighOrderMesh> check_meshes() {
  std::vector<HighOrderMesh> meshes;
  // Those of order 6 have the kernels of all cells.
  for (const int order : {2, 3, 4, 5, 6}) meshes.push_back(grid(kTetrahedra, order));
  for (const int order : {2, 3, 4, 5, 6}) meshes.push_back(grid(kTriangles, order));
  for (const Cut* cut : {&kQuadrilaterals, &kPrisms, &kHexahedra})
    for (const int order : {2, 3, 4}) meshes.push_back(grid(*cut, order));
  return meshes;
}

bool same_numbers(std::span<const double> one, std::span<const double> other) {
  return std::ranges::equal(one, other, [](double a, double b) {
    return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b) || (std::isnan(a) && std::isnan(b));
  });
}

tl::unexpected<Fault> other_numbers(const Device& device, const HighOrderMesh& mesh) {
  const std::string shape(reference::info(mesh.blocks.front().shape).plural);
  return fault(Fault::Kind::BadKernels, "The device " + device.properties().name +
                                            " computes other numbers than the processor on " + shape + " of order " +
                                            std::to_string(mesh.order) +
                                            ". This is an error in VariMesh or in the driver; please report it.");
}

Possible<void> check_kernels(Device& device) {
  const auto cpu = make_cpu_device();
  const Material material = varimesh::material(Options{});
  for (const HighOrderMesh& mesh : check_meshes()) {
    Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
    problem.positions = solver_positions(mesh, frame_of(mesh));
    set_straight_sided_targets(problem);
    for (CellSet& set : problem.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.01);
    const auto theirs = results(*cpu, problem, material), ours = results(device, problem, material);
    if (!ours) return tl::unexpected(ours.error());
    if (!theirs) return tl::unexpected(theirs.error());
    if (*ours != *theirs) return other_numbers(device, mesh);
  }
  return {};
}

}  // namespace varimesh::device
