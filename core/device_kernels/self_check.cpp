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

/// Eighteen triangles in a row of nine squares: a full batch and a part of one.
HighOrderMesh triangles(int order) {
  HighOrderMesh mesh = empty_mesh(2, Shape::Triangle);
  constexpr int kSquares = 9;
  for (int column = 0; column <= kSquares; ++column)
    for (const int row : {0, 1}) add_node(mesh, {column, row, 0});
  for (int first = 0; first < 2 * kSquares; first += 2) {
    add_cell(mesh, {first, first + 2, first + 3});
    add_cell(mesh, {first, first + 3, first + 1});
  }
  return bent(std::move(mesh), order);
}

/// Eighteen tetrahedra in a row of three cubes.
HighOrderMesh tetrahedra(int order) {
  HighOrderMesh mesh = empty_mesh(3, Shape::Tetrahedron);
  constexpr int kCubes = 3;
  for (int plane = 0; plane <= kCubes; ++plane)
    for (int corner = 0; corner < 4; ++corner) add_node(mesh, {plane, corner % 2, corner / 2});
  // The six tetrahedra around a cube's diagonal, as bits: 1 the next plane, 2 the second corner, 4 the third.
  constexpr int kAround[][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  for (int cube = 0; cube < kCubes; ++cube) {
    const auto node = [&](int bits) { return 4 * (cube + bits % 2) + bits / 2; };
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

Possible<void> check_kernels(Device& device) {
  const auto cpu = make_cpu_device();
  const Material material = varimesh::material(Options{});
  // Those of order 6 have the kernels of cells of any shape.
  const HighOrderMesh meshes[] = {tetrahedra(2), tetrahedra(3), tetrahedra(4),
                                  tetrahedra(5), tetrahedra(6), triangles(3)};
  for (const HighOrderMesh& mesh : meshes) {
    Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
    problem.positions = solver_positions(mesh, frame_of(mesh));
    set_straight_sided_targets(problem);
    for (CellSet& set : problem.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.01);
    const auto theirs = results(*cpu, problem, material), ours = results(device, problem, material);
    if (!ours) return tl::unexpected(ours.error());
    if (!theirs) return tl::unexpected(theirs.error());
    if (*ours != *theirs)
      return fault(Fault::Kind::BadKernels,
                   "The device " + device.properties().name +
                       " computes other numbers than the processor on cells of order " + std::to_string(mesh.order) +
                       " in " + std::to_string(mesh.dimension) +
                       " dimensions. This is an error in VariMesh or in the driver; please report it.");
  }
  return {};
}

}  // namespace varimesh::device
