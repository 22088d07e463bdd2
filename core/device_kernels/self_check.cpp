#include "core/device_kernels/self_check.h"

#include <cmath>
#include <cstring>
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

/// Eighteen tetrahedra in a row of three cubes, with their nodes moved a little: a full batch and a part of one.
HighOrderMesh small_mesh(int order) {
  HighOrderMesh mesh;
  mesh.dimension = 3;
  mesh.order = 1;
  constexpr int kCubes = 3;
  for (int plane = 0; plane <= kCubes; ++plane)
    for (int corner = 0; corner < 4; ++corner) {
      for (const int x : {plane, corner % 2, corner / 2}) mesh.coordinates.push_back(x);
      mesh.node_numbers.push_back(static_cast<std::int64_t>(mesh.node_numbers.size()) + 1);
    }
  mesh.node_blocks = {{3, 1, 0, static_cast<std::int32_t>(mesh.node_count())}};
  ElementBlock& block = mesh.blocks.emplace_back();
  block.shape = Shape::Tetrahedron;
  block.entity = 1;
  // The six tetrahedra around a cube's diagonal, as bits: 1 the next plane, 2 the second corner, 4 the third.
  constexpr int kAround[][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7}, {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  for (int cube = 0; cube < kCubes; ++cube)
    for (const auto& tetrahedron : kAround) {
      block.numbers.push_back(static_cast<std::int64_t>(block.numbers.size()) + 1);
      for (const int bits : tetrahedron) block.nodes.push_back(4 * (cube + bits % 2) + bits / 2);
    }
  HighOrderMesh curved = *change_order(mesh, order);
  const std::vector<double> straight = curved.coordinates;
  for (std::size_t i = 0; i < straight.size(); ++i)
    curved.coordinates[i] += 0.05 / (order * order) * std::sin(static_cast<double>(5 * i + 1));
  return curved;
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
  for (const int order : {2, 3, 4, 5}) {
    const HighOrderMesh mesh = small_mesh(order);
    Problem problem = build_problem(mesh, fixed_nodes(mesh), 0);
    problem.positions = solver_positions(mesh, frame_of(mesh));
    set_straight_sided_targets(problem);
    for (CellSet& set : problem.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.01);
    const auto theirs = results(*cpu, problem, material), ours = results(device, problem, material);
    if (!ours) return tl::unexpected(ours.error());
    if (*ours != *theirs)
      return fault(Fault::Kind::BadKernels,
                   "The device " + device.properties().name +
                       " computes other numbers than the processor with the kernels of tetrahedra of order " +
                       std::to_string(order) + ". This is an error in VariMesh or in the driver; please report it.");
  }
  return {};
}

}  // namespace varimesh::device
