#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <unsupported/Eigen/BVH>
#include <utility>

#include "core/geometry/element_map.h"
#include "core/geometry/foot_on_element.h"
#include "core/geometry/pieces.h"
#include "core/reference/nodes.h"

namespace varimesh::geometry {
namespace {

/// How far apart the values of u of two pieces are.
constexpr double kStride = 4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
/// A foot must be nearer by this factor to be taken in place of another: between equal ones the search would not end.
constexpr double kNearer = 1 - 1e-9;
/// A point that is nearer than this to a piece, relative to its size, lies on it.
constexpr double kOnIt = 1e-13;
/// An element reaches beyond the box of its nodes by at most about this part of the box's diagonal.
constexpr double kBeyondNodes = 0.2;

using Box = Eigen::AlignedBox3d;

Box box_of(const ElementMap& map) {
  Box box;
  for (Eigen::Index node = 0; node < map.nodes().cols(); ++node) box.extend(Eigen::Vector3d(map.nodes().col(node)));
  const Eigen::Vector3d more = Eigen::Vector3d::Constant(kBeyondNodes * box.diagonal().norm());
  return {box.min() - more, box.max() + more};
}

class Patchwork : public SurfaceShape, public PieceSearch {
 public:
  Patchwork(std::vector<SurfacePiece> pieces, int order) {
    std::map<std::int32_t, std::vector<std::size_t>> around;  // by vertex
    for (std::size_t k = 0; k < pieces.size(); ++k) {
      const auto vertices = static_cast<std::size_t>(reference::info(pieces[k].shape).vertices);
      vertices_.emplace_back(pieces[k].numbers.begin(),
                             pieces[k].numbers.begin() + static_cast<std::ptrdiff_t>(vertices));
      for (const std::int32_t vertex : vertices_.back()) around[vertex].push_back(k);
      maps_.emplace_back(pieces[k].shape, order, std::move(pieces[k].x));
      boxes_.push_back(box_of(maps_.back()));
      straight_.push_back(straight_normal(maps_.back()));
    }
    neighbours_.resize(maps_.size());
    for (std::size_t k = 0; k < maps_.size(); ++k) {
      for (const std::int32_t vertex : vertices_[k])
        neighbours_[k].insert(neighbours_[k].end(), around[vertex].begin(), around[vertex].end());
      std::ranges::sort(neighbours_[k]);
      const auto repeated = std::ranges::unique(neighbours_[k]);
      neighbours_[k].erase(repeated.begin(), repeated.end());
      std::erase(neighbours_[k], k);
    }
    std::vector<int> numbers(maps_.size());
    for (std::size_t k = 0; k < numbers.size(); ++k) numbers[k] = static_cast<int>(k);
    tree_.init(numbers.begin(), numbers.end(), boxes_.begin(), boxes_.end());
  }

  SurfacePoint at(double u, double v) const override {
    const std::size_t k = piece_at(u);
    return maps_[k].at(u - kStride * static_cast<double>(k), v);
  }
  Range u_range() const override { return {-1, kStride * static_cast<double>(maps_.size() - 1) + 1}; }
  Range v_range() const override { return {-1, 1}; }
  Eigen::Vector3d normal(const SurfacePoint& at, double u, double /*v*/) const override {
    const Eigen::Vector3d& side = straight_[piece_at(u)];
    const Eigen::Vector3d normal = at.normal();
    if (normal == Eigen::Vector3d::Zero()) return side;
    return normal.dot(side) < 0 ? Eigen::Vector3d(-normal) : normal;
  }
  const PieceSearch* pieces() const override { return this; }
  bool contains(double u, double v) const override {
    const std::size_t k = piece_at(u);
    return is_in_element(maps_[k].shape(), {u - kStride * static_cast<double>(k), v});
  }

  SurfaceFoot closest_from(const Eigen::Vector3d& point, double u, double v) const override {
    std::size_t k = piece_at(u);
    ElementFoot best = foot_on_element(maps_[k], point, {u - kStride * static_cast<double>(k), v});
    for (bool moved = true; moved && best.on_border;) {
      moved = false;
      for (const std::size_t next : neighbours_[k]) {
        if (boxes_[next].squaredExteriorDistance(point) >= best.distance * best.distance) continue;
        const ElementFoot there = foot_on_element(maps_[next], point, nearest_node(maps_[next], point));
        if (!(there.distance < kNearer * best.distance)) continue;
        best = there;
        k = next;
        moved = true;
        break;
      }
    }
    return as_foot(k, best);
  }

  SurfaceFoot closest(const Eigen::Vector3d& point) const override {
    Nearest nearest{*this, point, {}, 0};
    nearest.best.distance = kInfinity;
    Eigen::BVMinimize(tree_, nearest);
    return as_foot(nearest.piece, nearest.best);
  }

  InterpolationError error() const;

 private:
  /// What Eigen's search in the tree of boxes calls.
  struct Nearest {
    using Scalar = double;
    const Patchwork& of;
    const Eigen::Vector3d& point;
    ElementFoot best;
    std::size_t piece;

    double minimumOnVolume(const Box& box) const { return box.squaredExteriorDistance(point); }
    double minimumOnObject(int k) {
      const ElementFoot foot = nearest_foot(of.maps_[static_cast<std::size_t>(k)], point);
      // The order in which the tree comes to equally near pieces says nothing, so the first of them is taken.
      if (foot.distance < kNearer * best.distance ||
          (foot.distance * kNearer <= best.distance && static_cast<std::size_t>(k) < piece)) {
        best = foot;
        piece = static_cast<std::size_t>(k);
      }
      const double size = of.boxes_[static_cast<std::size_t>(k)].diagonal().norm();
      return foot.distance < kOnIt * size ? 0 : foot.distance * foot.distance;  // 0 ends the search
    }
  };

  static Eigen::Vector3d straight_normal(const ElementMap& map) {
    const auto& x = map.nodes();
    const Eigen::Index last = map.shape() == Shape::Triangle ? 2 : 3;
    const Eigen::Vector3d one = map.shape() == Shape::Triangle ? x.col(1) - x.col(0) : x.col(2) - x.col(0);
    const Eigen::Vector3d other = x.col(last) - x.col(map.shape() == Shape::Triangle ? 0 : 1);
    return one.cross(other).normalized();
  }

  /// A point on an edge of a piece: the piece's normal there, and how far the piece goes on from there.
  struct EdgePoint {
    Eigen::Vector3d normal;
    double across;
  };
  /// @param s  from the vertex with number a to that with number b
  EdgePoint on_edge(std::size_t k, std::int32_t a, std::int32_t b, double s) const;
  /// Which vertex of the piece has this number; −1: none.
  int place_of(std::size_t k, std::int32_t number) const {
    const auto found = std::ranges::find(vertices_[k], number);
    return found == vertices_[k].end() ? -1 : static_cast<int>(found - vertices_[k].begin());
  }
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }

  std::size_t piece_at(double u) const {
    const double most = static_cast<double>(maps_.size() - 1);
    return static_cast<std::size_t>(std::clamp(std::floor(u / kStride + 0.5), 0.0, most));
  }
  static SurfaceFoot as_foot(std::size_t k, const ElementFoot& foot) {
    return {kStride * static_cast<double>(k) + foot.at[0], foot.at[1], foot.x, foot.distance};
  }

  std::vector<ElementMap> maps_;
  std::vector<std::vector<std::int32_t>> vertices_;   ///< By piece: the numbers of its vertices.
  std::vector<std::vector<std::size_t>> neighbours_;  ///< By piece: those that share a vertex with it.
  std::vector<Eigen::Vector3d> straight_;             ///< By piece: the unit normal of its straight-sided form.
  std::vector<Box> boxes_;
  Eigen::KdBVH<double, 3, int> tree_;
};

// Where two pieces meet, their normals differ by the errors of their slopes across the edge.
InterpolationError Patchwork::error() const {
  const double factor = error_over_slope(maps_.front().order()) / 2;  // each of two neighbours has half the angle
  InterpolationError error;
  double squares = 0, samples = 0;
  for (std::size_t k = 0; k < maps_.size(); ++k)
    for (const reference::Facet& edge : reference::info(maps_[k].shape()).facets) {
      const std::int32_t a = vertices_[k][index(edge.vertices[0])], b = vertices_[k][index(edge.vertices[1])];
      for (const std::size_t next : neighbours_[k]) {
        if (next < k || place_of(next, a) < 0 || place_of(next, b) < 0) continue;
        for (const double s : {0.25, 0.5, 0.75}) {
          const EdgePoint one = on_edge(k, a, b, s), other = on_edge(next, a, b, s);
          const double off = factor * one.normal.cross(other.normal).norm() * std::min(one.across, other.across);
          error.largest = std::max(error.largest, off);
          squares += off * off;
          samples += 1;
        }
      }
    }
  error.rms = samples > 0 ? std::sqrt(squares / samples) : 0;
  return error;
}

Patchwork::EdgePoint Patchwork::on_edge(std::size_t k, std::int32_t a, std::int32_t b, double s) const {
  const ElementMap& map = maps_[k];
  const auto corner = [&](int i) {
    const auto& x = reference::info(map.shape()).vertex[index(i)];
    return Eigen::Vector2d(x[0], x[1]);
  };
  const int i = place_of(k, a), j = place_of(k, b);
  const Eigen::Vector2d on = (1 - s) * corner(i) + s * corner(j);
  // Of a triangle its third vertex, of a quadrilateral the point on the opposite side.
  const Eigen::Vector2d far =
      map.shape() == Shape::Triangle ? corner(3 - i - j) : Eigen::Vector2d(on - (corner(i) + corner(j)));
  const SurfacePoint p = map.at(on[0], on[1]);
  return {p.normal(), (map.at(far[0], far[1]).x - p.x).norm()};
}

}  // namespace

PieceSurface surface_of_pieces(std::vector<SurfacePiece> pieces, int order) {
  assert(!pieces.empty());
  const auto patchwork = std::make_shared<Patchwork>(std::move(pieces), order);
  return {patchwork, patchwork->error()};
}

std::array<double, 2> parameters_of_node(const SurfacePiece& piece, std::size_t number_of_piece, int order,
                                         std::size_t node) {
  const auto& place = reference::lattice(piece.shape, order)[node];
  return {kStride * static_cast<double>(number_of_piece) - 1 + 2.0 * place[0] / order, -1 + 2.0 * place[1] / order};
}

}  // namespace varimesh::geometry
