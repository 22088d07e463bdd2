#include "core/device_kernels/self_check.h"

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

void add_cell(HighOrderMesh& mesh, std::initializer_list<int> nodes) {
  ElementBlock& block = mesh.blocks.front();
  block.numbers.push_back(static_cast<std::int64_t>(block.numbers.size()) + 1);
  block.nodes.insert(block.nodes.end(), nodes.begin(), nodes.end());
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

/// The number of a grid's node with these coordinates, of `points` in each direction.
int node_of(int points, int x, int y, int z) { return (z * points + y) * points + x; }

/// Eighteen triangles in nine squares: a full batch and a part of one.
HighOrderMesh triangles(int order) {
  HighOrderMesh mesh = empty_mesh(2, Shape::Triangle);
  constexpr int kSquares = 3, kPoints = kSquares + 1;
  for (int y = 0; y < kPoints; ++y)
    for (int x = 0; x < kPoints; ++x) add_node(mesh, {x, y, 0});
  for (int y = 0; y < kSquares; ++y)
    for (int x = 0; x < kSquares; ++x) {
      const int first = node_of(kPoints, x, y, 0);
      add_cell(mesh, {first, first + 1, first + kPoints + 1});
      add_cell(mesh, {first, first + kPoints + 1, first + kPoints});
    }
  return bent(std::move(mesh), order);
}

/// Forty-eight tetrahedra in eight cubes.
HighOrderMesh tetrahedra(int order) {
  HighOrderMesh mesh = empty_mesh(3, Shape::Tetrahedron);
  constexpr int kCubes = 2, kPoints = kCubes + 1;
  for (int z = 0; z < kPoints; ++z)
    for (int y = 0; y < kPoints; ++y)
      for (int x = 0; x < kPoints; ++x) add_node(mesh, {x, y, z});
  // The six tetrahedra around a cube's diagonal, as bits: 1 the next x, 2 the next y, 4 the next z.
  constexpr int kAround[][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  for (int cube = 0; cube < kCubes * kCubes * kCubes; ++cube) {
    const auto node = [&](int bits) {
      return node_of(kPoints, cube % 2 + bits % 2, cube / 2 % 2 + bits / 2 % 2, cube / 4 + bits / 4);
    };
    for (const auto& [a, b, c, d] : kAround) add_cell(mesh, {node(a), node(b), node(c), node(d)});
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
  // Those of order 6 have the kernels of cells of any shape.
  return {tetrahedra(2), tetrahedra(3), tetrahedra(4), tetrahedra(5), tetrahedra(6), triangles(3)};
}

tl::unexpected<Fault> other_numbers(const Device& device, const HighOrderMesh& mesh) {
  return fault(Fault::Kind::BadKernels, "The device " + device.properties().name +
                                            " computes other numbers than the processor on cells of order " +
                                            std::to_string(mesh.order) + " in " + std::to_string(mesh.dimension) +
                                            " dimensions. This is an error in VariMesh or in the driver; please report "
                                            "it.");
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
