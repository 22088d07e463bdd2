#include "core/layers/grow/extrusion.h"

#include <array>
#include <map>
#include <mutex>
#include <utility>

#include "core/base/index.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

Shape shape_on(Shape base) {
  switch (base) {
    case Shape::Point:
      return Shape::Line;
    case Shape::Line:
      return Shape::Quadrilateral;
    case Shape::Triangle:
      return Shape::Prism;
    default:
      return Shape::Hexahedron;
  }
}

Extrusion make(Shape base, int order) {
  Extrusion made;
  made.shape = shape_on(base);
  const int dimension = reference::info(base).dimension;
  std::map<std::array<std::int8_t, 3>, int> nodes;  // of the base, by their place on the lattice
  if (base == Shape::Point)
    nodes[{}] = 0;
  else
    for (const auto& place : reference::lattice(base, order)) nodes.emplace(place, static_cast<int>(nodes.size()));
  for (std::array<std::int8_t, 3> place : reference::lattice(made.shape, order)) {
    const int level = std::exchange(place[at(dimension)], std::int8_t{0});
    made.nodes.push_back({nodes.at(place), level});
  }
  return made;
}

}  // namespace

const Extrusion& extrusion(Shape base, int order) {
  static std::mutex mutex;
  static std::map<std::pair<Shape, int>, Extrusion> made;
  const std::scoped_lock lock(mutex);
  const auto found = made.find({base, order});
  return found != made.end() ? found->second : made.emplace(std::pair(base, order), make(base, order)).first->second;
}

}  // namespace varimesh::detail
