#include "core/layers/split/cut_pattern.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

using Logical = std::array<double, 4>;
using Weights = std::array<double, 8>;

constexpr CutAxis kLine[] = {{{{{0, 1}}}, 1}};
constexpr CutAxis kTriangle[] = {{{{{0, 1}}}, 1}, {{{{1, 2}}}, 1}, {{{{2, 0}}}, 1}};
constexpr CutAxis kQuadrilateral[] = {{{{{0, 1}, {3, 2}}}, 2}, {{{{0, 3}, {1, 2}}}, 2}};
constexpr CutAxis kTetrahedron[] = {{{{{0, 1}}}, 1}, {{{{1, 2}}}, 1}, {{{{2, 0}}}, 1},
                                    {{{{3, 0}}}, 1}, {{{{3, 2}}}, 1}, {{{{3, 1}}}, 1}};
constexpr CutAxis kPrism[] = {
    {{{{0, 3}, {1, 4}, {2, 5}}}, 3}, {{{{0, 1}, {3, 4}}}, 2}, {{{{1, 2}, {4, 5}}}, 2}, {{{{2, 0}, {5, 3}}}, 2}};
constexpr CutAxis kHexahedron[] = {{{{{0, 1}, {3, 2}, {4, 5}, {7, 6}}}, 4},
                                   {{{{0, 3}, {1, 2}, {4, 7}, {5, 6}}}, 4},
                                   {{{{0, 4}, {1, 5}, {2, 6}, {3, 7}}}, 4}};

/// Whether a cell is cut into a fan along this axis, from the vertices that the axis does not have.
bool is_fan(Shape shape, const CutAxis& axis) {
  return shape == Shape::Triangle || shape == Shape::Tetrahedron || (shape == Shape::Prism && axis.count == 2);
}

/// The logical coordinate along an axis that is no fan.
std::size_t coordinate_of(Shape shape, const CutAxis& axis) {
  if (shape == Shape::Prism) return 3;
  const int end = axis.edges[0][1];
  return end == 1 ? 0 : end == 3 ? 1 : 2;
}

double share_of(Shape shape, const CutAxis& axis, const Logical& logical) {
  if (!is_fan(shape, axis)) return logical[coordinate_of(shape, axis)];
  const double a = logical[at(axis.edges[0][0])], b = logical[at(axis.edges[0][1])];
  return a + b > 0 ? b / (a + b) : 0;
}

/// Logical coordinates of a node from its position on the lattice, without rounding errors at the ends.
Logical logical_of_node(Shape shape, int order, const std::array<std::int8_t, 3>& node) {
  const auto part = [&](int i, int of) { return static_cast<double>(i) / of; };
  const int i = node[0], j = node[1], k = node[2];
  switch (shape) {
    case Shape::Triangle:
      return {part(order - i - j, order), part(i, order), part(j, order), 0};
    case Shape::Tetrahedron:
      return {part(order - i - j - k, order), part(i, order), part(j, order), part(k, order)};
    case Shape::Prism:
      return {part(order - i - j, order), part(i, order), part(j, order), part(k, order)};
    case Shape::Pyramid:
      if (k == order) return {0.5, 0.5, 1, 0};
      return {part(i, order - k), part(j, order - k), part(k, order), 0};
    default:
      return {part(i, order), part(j, order), part(k, order), 0};
  }
}

/// The linear functions of the vertices.
Weights vertex_weights(Shape shape, const Logical& l) {
  const double x = l[0], y = l[1], z = l[2];
  const std::array<double, 4> base{(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y};
  switch (shape) {
    case Shape::Line:
      return {1 - x, x};
    case Shape::Triangle:
    case Shape::Tetrahedron:
      return {l[0], l[1], l[2], l[3]};
    case Shape::Quadrilateral:
      return {base[0], base[1], base[2], base[3]};
    case Shape::Prism:
      return {x * (1 - l[3]), y * (1 - l[3]), z * (1 - l[3]), x * l[3], y * l[3], z * l[3]};
    case Shape::Pyramid:
      return {base[0] * (1 - z), base[1] * (1 - z), base[2] * (1 - z), base[3] * (1 - z), z};
    default:
      return {base[0] * (1 - z), base[1] * (1 - z), base[2] * (1 - z), base[3] * (1 - z),
              base[0] * z,       base[1] * z,       base[2] * z,       base[3] * z};
  }
}

using Key = std::array<std::int64_t, 4>;
Key key_of(const Logical& logical) {
  Key key{};
  for (std::size_t c = 0; c < 4; ++c) key[c] = std::llround(1e9 * logical[c]);
  return key;
}

class PatternMaker {
 public:
  PatternMaker(Shape shape, int order, std::vector<CutAxis> axes, std::vector<int> parts)
      : info_(reference::info(shape)), lattice_(reference::lattice(shape, order)) {
    pattern_.shape = shape;
    pattern_.order = order;
    pattern_.axes = std::move(axes);
    pattern_.parts = std::move(parts);
    for (std::size_t node = 0; node < lattice_.size(); ++node)
      node_at_[key_of(logical_of_node(shape, order, lattice_[node]))] = static_cast<int>(node);
    find_cut_faces();
  }

  CutPattern make() {
    for (const int parts : pattern_.parts) pattern_.count *= parts;
    for (int part = 0; part < pattern_.count; ++part)
      for (const auto& node : lattice_) pattern_.nodes.push_back(point_of(part, node));
    if (pattern_.axes.size() == 1 && !is_fan(pattern_.shape, pattern_.axes[0]) && pattern_.shape != Shape::Pyramid)
      for (const CutPoint& point : pattern_.points) add_line(point.logical);
    return std::move(pattern_);
  }

 private:
  void add_line(Logical logical) {
    for (int step = 0; step <= pattern_.order; ++step) {
      set_share(pattern_.shape, pattern_.axes[0], static_cast<double>(step) / pattern_.order, logical);
      pattern_.lines.push_back(node_at_.at(key_of(logical)));
    }
  }

  /// The number of parts of the edge between two vertices, and how it is directed; 0: it is not cut.
  int parts_of(int a, int b, std::array<std::int8_t, 2>* directed = nullptr) const {
    for (std::size_t axis = 0; axis < pattern_.axes.size(); ++axis)
      for (int e = 0; e < pattern_.axes[axis].count; ++e) {
        const auto& edge = pattern_.axes[axis].edges[at(e)];
        if ((edge[0] != a || edge[1] != b) && (edge[0] != b || edge[1] != a)) continue;
        if (directed != nullptr) *directed = edge;
        return pattern_.parts[axis];
      }
    return 0;
  }

  void find_cut_faces() {
    const int order = pattern_.order;
    for (const auto& edge : info_.edges) {
      const int parts = parts_of(edge[0], edge[1]);
      pattern_.edges.push_back({parts > 0, {order * std::max(parts, 1), 1}});
    }
    for (const reference::Facet& face : info_.faces) {
      CutFace cut;
      const auto& v = face.vertices;
      if (face.shape == Shape::Quadrilateral) {
        const int first = parts_of(v[0], v[1]), second = parts_of(v[0], v[3]);
        cut = {first > 0 || second > 0, {order * std::max(first, 1), order * std::max(second, 1)}};
      } else {
        for (std::size_t e = 0; e < 3; ++e)
          if (const int parts = parts_of(v[e], v[(e + 1) % 3], &cut.edge); parts > 0)
            cut.is_cut = true, cut.steps = {parts, order};
      }
      pattern_.faces.push_back(cut);
    }
  }

  std::int32_t point_of(int part, const std::array<std::int8_t, 3>& node) {
    const Shape shape = pattern_.shape;
    Logical logical = logical_of_node(shape, pattern_.order, node);
    for (std::size_t axis = 0; axis < pattern_.axes.size(); ++axis) {
      const int parts = pattern_.parts[axis], along = part % parts;
      const double share = share_of(shape, pattern_.axes[axis], logical);
      set_share(shape, pattern_.axes[axis], (along + share) / parts, logical);
      part /= parts;
    }
    const auto [found, is_new] = known_.try_emplace(key_of(logical), static_cast<std::int32_t>(pattern_.points.size()));
    if (is_new) pattern_.points.push_back(describe(logical));
    return found->second;
  }

  CutPoint describe(const Logical& logical) {
    const Weights weights = vertex_weights(pattern_.shape, logical);
    CutPoint point;
    point.logical = logical;
    find_place(weights, point);
    for (std::size_t axis = 0; axis < pattern_.axes.size(); ++axis) {
      const double along = share_of(pattern_.shape, pattern_.axes[axis], logical) * pattern_.parts[axis];
      point.part[axis] = std::min(static_cast<int>(along + 1e-9), pattern_.parts[axis] - 1);
      point.xi[axis] = std::clamp(along - point.part[axis], 0.0, 1.0);
      double sum = 0;
      for (int e = 0; e < pattern_.axes[axis].count; ++e) {
        const auto& edge = pattern_.axes[axis].edges[at(e)];
        sum += point.weight[axis][at(e)] = weights[at(edge[0])] + weights[at(edge[1])];
      }
      for (double& weight : point.weight[axis]) weight = sum > 0 ? weight / sum : 0;
    }
    return point;
  }

  /// Finds the smallest part of the parent in which the point lies, and its number there.
  void find_place(const Weights& weights, CutPoint& point) {
    const auto is_inside = [&](std::span<const std::int8_t> vertices) {
      double sum = 0;
      for (const std::int8_t v : vertices)
        if (v >= 0) sum += weights[at(v)];
      for (std::size_t v = 0; v < weights.size(); ++v)
        if (weights[v] > 0 && std::ranges::find(vertices, static_cast<std::int8_t>(v)) == vertices.end()) return false;
      return sum > 0;
    };
    const auto is_old = [&] {
      const auto found = node_at_.find(key_of(point.logical));
      assert(found != node_at_.end());
      point.node = found->second;
    };
    if (std::ranges::count_if(weights, [](double weight) { return weight > 0; }) == 1) return is_old();
    for (std::size_t e = 0; e < info_.edges.size(); ++e) {
      if (!is_inside(info_.edges[e])) continue;
      if (!pattern_.edges[e].is_cut) return is_old();
      point.dimension = 1;
      point.index = static_cast<int>(e);
      point.at[0] = static_cast<int>(std::lround(weights[at(info_.edges[e][1])] * pattern_.edges[e].steps[0]));
      return;
    }
    for (std::size_t f = 0; f < info_.faces.size(); ++f) {
      if (!is_inside(info_.faces[f].vertices)) continue;
      if (!pattern_.faces[f].is_cut) return is_old();
      point.dimension = 2;
      point.index = static_cast<int>(f);
      point.at = place_on(f, weights);
      return;
    }
    point.dimension = 3;
    point.index = pattern_.inner++;
  }

  std::array<int, 2> place_on(std::size_t face, const Weights& weights) const {
    const CutFace& cut = pattern_.faces[face];
    const auto w = [&](int v) { return weights[at(v)]; };
    const auto& v = info_.faces[face].vertices;
    if (info_.faces[face].shape == Shape::Quadrilateral)
      return {static_cast<int>(std::lround(cut.steps[0] * (w(v[1]) + w(v[2])))),
              static_cast<int>(std::lround(cut.steps[1] * (w(v[2]) + w(v[3]))))};
    const double both = w(cut.edge[0]) + w(cut.edge[1]);
    const auto row = static_cast<int>(std::lround(cut.steps[1] * both));
    return {static_cast<int>(std::lround(cut.steps[0] * row * w(cut.edge[1]) / both)), row};
  }

  const reference::ShapeInfo& info_;
  const std::vector<std::array<std::int8_t, 3>>& lattice_;
  CutPattern pattern_;
  std::map<Key, int> node_at_;
  std::map<Key, std::int32_t> known_;
};

}  // namespace

std::span<const CutAxis> cut_axes(Shape shape) {
  switch (shape) {
    case Shape::Point:
      return {};
    case Shape::Line:
      return kLine;
    case Shape::Triangle:
      return kTriangle;
    case Shape::Quadrilateral:
      return kQuadrilateral;
    case Shape::Tetrahedron:
      return kTetrahedron;
    case Shape::Pyramid:
      return kQuadrilateral;
    case Shape::Prism:
      return kPrism;
    case Shape::Hexahedron:
      return kHexahedron;
  }
  return {};
}

bool can_cut(Shape shape, std::span<const CutAxis* const> axes) {
  return std::ranges::count_if(axes, [&](const CutAxis* axis) { return is_fan(shape, *axis); }) <= 1;
}

CutPattern make_pattern(Shape shape, int order, std::vector<CutAxis> axes, std::vector<int> parts) {
  return PatternMaker(shape, order, std::move(axes), std::move(parts)).make();
}

std::array<double, 3> reference_of(Shape shape, const std::array<double, 4>& logical) {
  const auto to = [](double x) { return -1 + 2 * x; };
  switch (shape) {
    case Shape::Triangle:
    case Shape::Tetrahedron:
    case Shape::Prism:
      return {to(logical[1]), to(logical[2]), to(logical[3])};
    case Shape::Pyramid:
      return {(1 - logical[2]) * to(logical[0]), (1 - logical[2]) * to(logical[1]), to(logical[2])};
    default:
      return {to(logical[0]), to(logical[1]), to(logical[2])};
  }
}

void set_share(Shape shape, const CutAxis& axis, double share, std::array<double, 4>& logical) {
  if (!is_fan(shape, axis)) {
    const bool is_apex = shape == Shape::Pyramid && logical[2] == 1;
    if (!is_apex) logical[coordinate_of(shape, axis)] = share;
    return;
  }
  double& a = logical[at(axis.edges[0][0])];
  double& b = logical[at(axis.edges[0][1])];
  const double both = a + b;
  b = both * share;
  a = both - b;
}

}  // namespace varimesh::detail
