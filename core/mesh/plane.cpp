#include "core/mesh/plane.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "core/mesh/bounding_box.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"

namespace varimesh {

namespace {

using Vector = std::array<double, 3>;

Vector minus(const double* a, const double* b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// Zero stays zero.
Vector unit(Vector a) {
  const double length = std::hypot(a[0], a[1], a[2]);
  for (double& x : a) x = length > 0 ? x / length : 0;
  return a;
}

/// The sum of the cells' normals, as their vertices are numbered: twice their areas.
Vector summed_normal(const HighOrderMesh& mesh) {
  const Cells cells(mesh, mesh.dimension);
  Vector sum{};
  for (const Cells::Range& range : cells.ranges()) {
    const auto vertices = static_cast<std::size_t>(reference::info(range.block->shape).vertices);
    for (std::size_t e = 0; e < range.block->size(); ++e) {
      const auto x = [&](std::size_t v) {
        return mesh.coordinates.data() + 3 * static_cast<std::size_t>(range.block->nodes[e * range.stride + v]);
      };
      const Vector normal =
          vertices == 3 ? cross(minus(x(1), x(0)), minus(x(2), x(0))) : cross(minus(x(2), x(0)), minus(x(3), x(1)));
      for (std::size_t k = 0; k < 3; ++k) sum[k] += normal[k];
    }
  }
  return sum;
}

const double* first_node(const Cells& cells, const HighOrderMesh& mesh) {
  return mesh.coordinates.data() + 3 * static_cast<std::size_t>(cells.nodes(0)[0]);
}

/// The normal of the widest triangle of nodes: the first node, the node farthest from it, and the node farthest from
/// the line through both. Rounding errors and noise of the nodes turn it least.
Vector widest_normal(const HighOrderMesh& mesh) {
  const Cells cells(mesh, mesh.dimension);
  const double* first = first_node(cells, mesh);
  const auto farthest = [&](const auto& distance) {
    const double* best = first;
    for (const Cells::Range& range : cells.ranges())
      for (const std::int32_t node : range.block->nodes)
        if (const double* x = mesh.coordinates.data() + 3 * static_cast<std::size_t>(node);
            distance(x) > distance(best))
          best = x;
    return best;
  };
  const double* second = farthest([&](const double* x) {
    const Vector d = minus(x, first);
    return dot(d, d);
  });
  const Vector along = unit(minus(second, first));
  const double* third = farthest([&](const double* x) {
    const Vector d = cross(along, minus(x, first));
    return dot(d, d);
  });
  return unit(cross(along, minus(third, first)));
}

}  // namespace

std::optional<Plane> Plane::of(const HighOrderMesh& mesh, const Team& team) {
  if (mesh.dimension != 2 || mesh.element_count(2) == 0 || !is_surface(mesh, team)) return std::nullopt;
  Plane plane;
  Vector& normal = plane.axes_[2];
  normal = widest_normal(mesh);
  if (dot(normal, summed_normal(mesh)) < 0)
    for (double& x : normal) x = -x;
  const auto largest = static_cast<std::size_t>(
      std::ranges::max_element(normal, {}, [](double x) { return std::abs(x); }) - normal.begin());
  constexpr double kAlongAxis = 1e-6;
  const double* first = first_node(Cells(mesh, mesh.dimension), mesh);
  plane.origin_ = {first[0], first[1], first[2]};
  if (1 - std::abs(normal[largest]) < kAlongAxis * kAlongAxis) {
    const double sign = normal[largest] > 0 ? 1 : -1;
    normal = {};
    normal[largest] = sign;
    plane.origin_ = {};
    plane.origin_[largest] = first[largest];
    Vector &u = plane.axes_[0], &v = plane.axes_[1];
    const std::size_t a = (largest + 1) % 3, b = (largest + 2) % 3;
    u[sign > 0 ? a : b] = 1;
    v[sign > 0 ? b : a] = 1;
  } else {
    const auto least = static_cast<std::size_t>(
        std::ranges::min_element(normal, {}, [](double x) { return std::abs(x); }) - normal.begin());
    Vector axis{};
    axis[least] = 1;
    for (std::size_t k = 0; k < 3; ++k) axis[k] -= normal[least] * normal[k];
    plane.axes_[0] = unit(axis);
    plane.axes_[1] = cross(normal, plane.axes_[0]);
  }
  HighOrderMesh flat = mesh;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const double* x = mesh.coordinates.data() + 3 * node;
    const auto [u, v] = plane.in_plane(x);
    flat.coordinates[3 * node] = u;
    flat.coordinates[3 * node + 1] = v;
    flat.coordinates[3 * node + 2] = dot(normal, minus(x, plane.origin_.data()));
  }
  if (!lies_flat(flat, team)) return std::nullopt;
  return plane;
}

std::array<double, 2> Plane::in_plane(const double* x) const {
  const Vector d = minus(x, origin_.data());
  return {dot(axes_[0], d), dot(axes_[1], d)};
}

std::array<double, 3> Plane::in_space(double u, double v) const {
  Vector x = origin_;
  for (std::size_t k = 0; k < 3; ++k) x[k] += axes_[0][k] * u + axes_[1][k] * v;
  return x;
}

void Plane::flatten(HighOrderMesh& mesh) {
  numbers_ = mesh.node_numbers;
  came_ = mesh.coordinates;
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    double* x = mesh.coordinates.data() + 3 * node;
    const auto [u, v] = in_plane(x);
    x[0] = u;
    x[1] = v;
    x[2] = 0;
  }
  flat_ = mesh.coordinates;
}

void Plane::put_back(HighOrderMesh& mesh) const {
  std::unordered_map<std::int64_t, std::size_t> places;
  for (std::size_t i = 0; i < numbers_.size(); ++i) places.emplace(numbers_[i], i);
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    double* x = mesh.coordinates.data() + 3 * node;
    const Vector now = in_space(x[0], x[1]);
    const auto found = places.find(mesh.node_numbers[node]);
    if (found == places.end()) {
      std::ranges::copy(now, x);
      continue;
    }
    const double *flat = flat_.data() + 3 * found->second, *came = came_.data() + 3 * found->second;
    const bool moved = x[0] != flat[0] || x[1] != flat[1];
    const Vector before = in_space(flat[0], flat[1]);
    for (std::size_t k = 0; k < 3; ++k) x[k] = moved ? now[k] + (came[k] - before[k]) : came[k];
  }
}

bool lies_in_a_plane(const HighOrderMesh& mesh, const Team& team) {
  return mesh.dimension == 2 && (!is_surface(mesh, team) || Plane::of(mesh, team));
}

bool lies_in_a_plane(const HighOrderMesh& mesh) { return lies_in_a_plane(mesh, Team(1)); }

}  // namespace varimesh
