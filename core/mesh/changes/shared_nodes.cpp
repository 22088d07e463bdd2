#include "core/mesh/changes/shared_nodes.h"

#include <cmath>

namespace varimesh::detail {

namespace {

FacePlace canonical_triangle(const Vertices& v, int i, int j, int order) {
  std::array<std::pair<std::int32_t, int>, 3> weights{{{v[0], order - i - j}, {v[1], i}, {v[2], j}}};
  std::sort(weights.begin(), weights.end());
  const int a = weights[1].second - 1, b = weights[2].second - 1;
  return {{weights[0].first, weights[1].first, weights[2].first, kNoNode},
          b * (order - 2) - b * (b - 1) / 2 + a,
          (order - 1) * (order - 2) / 2};
}

FacePlace canonical_quadrilateral(const Vertices& v, int i, int j, int order) {
  const auto start = std::size_t(std::min_element(v.begin(), v.end()) - v.begin());
  for (std::size_t turn = 0; turn < start; ++turn) {
    const int before = i;
    i = j;
    j = order - before;
  }
  if (v[(start + 3) % 4] < v[(start + 1) % 4]) std::swap(i, j);
  Vertices sorted = v;
  std::sort(sorted.begin(), sorted.end());
  return {sorted, (j - 1) * (order - 1) + i - 1, (order - 1) * (order - 1)};
}

}  // namespace

CellNodes cell_nodes(Shape shape, int order, int ambient) {
  const reference::ShapeInfo& info = reference::info(shape);
  const auto& places = reference::node_places(shape, order);
  const reference::Points& at = reference::nodes(shape, order, reference::NodeSet::Equispaced, ambient);
  CellNodes pattern;
  pattern.edges.resize(info.edges.size());
  pattern.faces.resize(info.faces.size());
  for (int local = info.vertices; local < int(places.size()); ++local) {
    const reference::NodePlace place = places[std::size_t(local)];
    if (place.dimension == 3) pattern.interior.push_back(local);
    if (place.dimension != 1) continue;
    const auto edge = std::size_t(place.index);
    const auto& start = info.vertex[std::size_t(info.edges[edge][0])];
    const auto& end = info.vertex[std::size_t(info.edges[edge][1])];
    double along = 0, length = 0;
    for (Eigen::Index k = 0; k < at.cols(); ++k) {
      const auto axis = std::size_t(k);
      along += (at(local, k) - start[axis]) * (end[axis] - start[axis]);
      length += (end[axis] - start[axis]) * (end[axis] - start[axis]);
    }
    pattern.edges[edge].push_back({local, int(std::lround(order * along / length)), 0});
  }
  for (std::size_t face = 0; face < info.faces.size(); ++face) {
    const Shape shape_of_face = info.faces[face].shape;
    const auto& lattice = reference::lattice(shape_of_face, order);
    for (std::size_t k = std::size_t(reference::info(shape_of_face).vertices); k < lattice.size(); ++k) {
      if (reference::node_places(shape_of_face, order)[k].dimension != 2) continue;
      const int local = info.dimension == 2 ? int(k) : reference::facet_nodes(shape, order, int(face))[k];
      pattern.faces[face].push_back({local, lattice[k][0], lattice[k][1]});
    }
  }
  return pattern;
}

FacePlace face_place(const Vertices& v, int i, int j, int order) {
  return v[3] == kNoNode ? canonical_triangle(v, i, j, order) : canonical_quadrilateral(v, i, j, order);
}

Vertices face_vertices(const reference::Facet& face, const std::int32_t* element) {
  Vertices v;
  for (std::size_t k = 0; k < 4; ++k) v[k] = face.vertices[k] < 0 ? kNoNode : element[face.vertices[k]];
  return v;
}

}  // namespace varimesh::detail
