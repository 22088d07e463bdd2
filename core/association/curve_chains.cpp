#include "core/association/curve_chains.h"

#include <algorithm>
#include <array>

namespace varimesh::detail {
namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

/// An end of a curve; 0: where its parameter begins, 1: where it ends.
struct End {
  int curve = -1;
  int which = 0;
  bool operator==(const End&) const = default;
};

class Chains {
 public:
  Chains(const geometry::Geometry& geometry, const std::vector<bool>& counts, double cosine)
      : geometry_(geometry), cosine_(cosine), at_(geometry.curves.size(), {-1, -1}), ends_(geometry.vertices.size()) {
    for (std::size_t c = 0; c < counts.size(); ++c)
      if (counts[c]) add(static_cast<int>(c));
    next_.resize(geometry.curves.size());
  }

  SmoothVertices find() {
    SmoothVertices result;
    for (std::size_t v = 0; v < ends_.size(); ++v) {
      if (ends_[v].empty()) result.without_curves.push_back(static_cast<int>(v));
      if (ends_[v].size() == 2 && is_smooth(ends_[v][0], ends_[v][1])) {
        next_[index(ends_[v][0].curve)][index(ends_[v][0].which)] = ends_[v][1];
        next_[index(ends_[v][1].curve)][index(ends_[v][1].which)] = ends_[v][0];
      }
    }
    std::vector<bool> seen(next_.size(), false);
    for (std::size_t c = 0; c < next_.size(); ++c) {
      if (seen[c] || (next_[c][0].curve < 0 && next_[c][1].curve < 0)) continue;
      result.chains.push_back(chain(static_cast<int>(c)));
      for (const CurveChain::Link& link : result.chains.back().links) seen[index(link.curve)] = true;
    }
    return result;
  }

 private:
  /// Notes which vertex each end of a curve is at.
  void add(int c) {
    const geometry::Curve& curve = geometry_.curves[index(c)];
    const geometry::Range range = curve.shape->range();
    for (int which = 0; which < 2 && !curve.vertices.empty(); ++which) {
      const Eigen::Vector3d x = curve.shape->at(which == 0 ? range.first : range.last).x;
      const int vertex = *std::ranges::min_element(
          curve.vertices, {}, [&](int v) { return (geometry_.vertices[index(v)].x - x).squaredNorm(); });
      at_[index(c)][index(which)] = vertex;
      ends_[index(vertex)].push_back({c, which});
    }
  }

  /// The unit tangent at an end, away from the curve's other end.
  Eigen::Vector3d outward(const End& end) const {
    const geometry::CurveShape& shape = *geometry_.curves[index(end.curve)].shape;
    const geometry::Range range = shape.range();
    const Eigen::Vector3d tangent = shape.at(end.which == 0 ? range.first : range.last).dt.normalized();
    return end.which == 0 ? Eigen::Vector3d(-tangent) : tangent;
  }

  bool is_smooth(const End& one, const End& other) const {
    const auto around = [&](const End& end) {
      std::vector<int> surfaces = geometry_.curves[index(end.curve)].surfaces;
      std::ranges::sort(surfaces);
      return surfaces;
    };
    return around(one) == around(other) && -outward(one).dot(outward(other)) >= cosine_;
  }

  /// The chain that a curve belongs to. It begins at an end without successor, or at the curve if there is none.
  CurveChain chain(int c) const {
    End in{c, 0};  // the end at which the first curve is entered
    for (End before = next_[index(c)][0]; before.curve >= 0;) {
      in = {before.curve, 1 - before.which};
      if (in.curve == c) {
        in = {c, 0};
        break;
      }
      before = next_[index(in.curve)][index(in.which)];
    }
    CurveChain result;
    const End start = in;
    while (true) {
      const End out{in.curve, 1 - in.which};
      const End next = next_[index(out.curve)][index(out.which)];
      result.links.push_back({in.curve, in.which == 1, next.curve >= 0 ? at_[index(out.curve)][index(out.which)] : -1});
      if (next.curve < 0) break;
      in = next;
      if (in == start) {
        result.closed = true;
        break;
      }
    }
    if (!result.closed) {
      const End out{in.curve, 1 - in.which};
      result.ends = {at_[index(start.curve)][index(start.which)], at_[index(out.curve)][index(out.which)]};
    }
    return result;
  }

  const geometry::Geometry& geometry_;
  double cosine_;
  std::vector<std::array<int, 2>> at_;    ///< By curve and end: its vertex.
  std::vector<std::vector<End>> ends_;    ///< By vertex: the ends of curves there.
  std::vector<std::array<End, 2>> next_;  ///< By curve and end: the end that it goes on to, if the vertex is smooth.
};

}  // namespace

SmoothVertices smooth_vertices(const geometry::Geometry& geometry, const std::vector<bool>& counts, double cosine) {
  return Chains(geometry, counts, cosine).find();
}

}  // namespace varimesh::detail
