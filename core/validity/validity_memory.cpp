#include "core/validity/validity_memory.h"

#include <algorithm>
#include <array>

#include "core/base/index.h"
#include "core/reference/nodes.h"
#include "core/validity/bernstein.h"
#include "core/validity/certificate_kernel.h"

namespace varimesh {
namespace {

/// Sizes of the spaces of a JacobianTable.
struct SpaceSizes {
  std::int64_t map = 0, nodes = 0, conversion = 0;  ///< `conversion`: entries that are not zero.
  std::array<std::int64_t, 3> derivative{};
  std::int64_t cross = 0, jacobian = 0;
};

std::int64_t line(std::int64_t degree) { return degree + 1; }
std::int64_t triangle(std::int64_t degree) { return (degree + 1) * (degree + 2) / 2; }
std::int64_t tetrahedron(std::int64_t degree) { return (degree + 1) * (degree + 2) * (degree + 3) / 6; }

/// The nodes of the closure of each node's place, added up.
std::int64_t conversion_entries(Shape shape, int order) {
  const std::int64_t P = order;
  std::int64_t entries = 0;
  for (const reference::NodePlace place : reference::node_places(shape, order)) {
    const reference::ShapeInfo& info = reference::info(shape);
    if (place.dimension == 0)
      entries += 1;
    else if (place.dimension == 1)
      entries += line(P);
    else if (place.dimension == info.dimension)
      entries += reference::node_count(shape, order);
    else
      entries += info.faces[at(place.index)].shape == Shape::Triangle ? triangle(P) : line(P) * line(P);
  }
  return entries;
}

SpaceSizes space_sizes(Shape shape, int order) {
  const std::int64_t P = order;
  SpaceSizes sizes;
  sizes.nodes = reference::node_count(shape, order);
  sizes.conversion = conversion_entries(shape, order);
  sizes.map = sizes.nodes;
  switch (shape) {
    case Shape::Triangle:
      sizes.derivative = {triangle(P - 1), triangle(P - 1), 0};
      sizes.jacobian = triangle(2 * P - 2);
      break;
    case Shape::Quadrilateral:
      sizes.derivative = {P * line(P), P * line(P), 0};
      sizes.jacobian = 4 * P * P;
      break;
    case Shape::Tetrahedron:
      sizes.derivative.fill(tetrahedron(P - 1));
      sizes.cross = tetrahedron(2 * P - 2);
      sizes.jacobian = tetrahedron(3 * P - 3);
      break;
    case Shape::Prism:
      sizes.derivative = {triangle(P - 1) * line(P), triangle(P - 1) * line(P), triangle(P) * P};
      sizes.cross = triangle(2 * P - 1) * 2 * P;
      sizes.jacobian = triangle(3 * P - 2) * 3 * P;
      break;
    case Shape::Pyramid:
      sizes.map = line(P) * line(P) * line(P);
      sizes.conversion = std::max(sizes.conversion, sizes.map * sizes.nodes / 2);
      sizes.derivative = {P * line(P) * P, P * line(P) * P, line(P) * line(P) * P};
      sizes.cross = line(2 * P) * 2 * P * (2 * P - 1);
      sizes.jacobian = 9 * P * P * (3 * P - 2);
      break;
    default:
      sizes.derivative.fill(P * line(P) * line(P));
      sizes.cross = line(2 * P) * 4 * P * P;
      sizes.jacobian = 27 * P * P * P;
  }
  return sizes;
}

}  // namespace

std::int64_t bytes_of_jacobian_tables(const MeshCounts& counts) {
  constexpr std::int64_t kPair = 2 * sizeof(std::uint16_t);
  constexpr std::int64_t kEntry = sizeof(std::uint16_t) + sizeof(double) + sizeof(detail::Quad);
  // Exponents and where to find them, starts, reciprocals, and the lines along which a subdivision cuts.
  constexpr std::int64_t kOfCoefficient = 120;
  const std::int64_t lookup = std::int64_t{sizeof(std::int32_t)} * (counts.dimension == 2 ? 1 << 10 : 1 << 15);
  std::int64_t bytes = 0;
  for (std::size_t s = 0; s < kShapes; ++s) {
    if (counts.cells[s] == 0) continue;
    const SpaceSizes sizes = space_sizes(static_cast<Shape>(s), counts.order);
    const auto& [a, b, c] = sizes.derivative;
    const std::int64_t pairs = counts.dimension == 2 ? a * b : b * c + a * sizes.cross;
    bytes += 6 * lookup + kPair * pairs + kEntry * sizes.conversion +
             kOfCoefficient * (sizes.jacobian + sizes.cross + a + b + c);
  }
  return bytes;
}

std::int64_t bytes_of_making_jacobian_tables(const MeshCounts& counts) {
  std::int64_t most = 0;
  for (std::size_t s = 0; s < kShapes; ++s) {
    if (counts.cells[s] == 0) continue;
    const SpaceSizes sizes = space_sizes(static_cast<Shape>(s), counts.order);
    most = std::max(most, static_cast<std::int64_t>(sizeof(detail::Quad)) * sizes.map * sizes.nodes);
  }
  return most;
}

std::int64_t bytes_of_certifier(std::int64_t cells) {
  return cells * static_cast<std::int64_t>(2 * sizeof(void*) + sizeof(std::int32_t));
}

std::int64_t bytes_of_certifying(const MeshCounts& counts) {
  const auto lanes = static_cast<std::int64_t>(detail::kernel_lanes());
  const std::int64_t d = counts.dimension;
  // Parts of the worst cell that are open at a time: the bounds of a mesh are sharpened by a few cuts.
  constexpr std::int64_t kParts = 16;
  std::int64_t most = 0;
  for (std::size_t s = 0; s < kShapes; ++s) {
    if (counts.cells[s] == 0) continue;
    const SpaceSizes sizes = space_sizes(static_cast<Shape>(s), counts.order);
    std::int64_t numbers = sizes.map * d + sizes.cross * d + sizes.jacobian;
    for (const std::int64_t derivative : sizes.derivative) numbers += derivative * d;
    most = std::max(most, static_cast<std::int64_t>(sizeof(double)) * (numbers * lanes + kParts * sizes.jacobian));
  }
  return most;
}

}  // namespace varimesh
