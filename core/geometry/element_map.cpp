#include "core/geometry/element_map.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/reference/nodes.h"

namespace varimesh::geometry {
namespace {

/// p_m(λ) = ∏_{k<m} (P λ − k)/(k + 1) for m = 0 … P, and its derivatives.
struct Silvester {
  std::array<double, kMaxOrder + 1> p{}, first{}, second{};

  Silvester(int order, double lambda) {
    p[0] = 1;
    for (std::size_t m = 0; m < static_cast<std::size_t>(order); ++m) {
      const double factor = order * lambda - static_cast<double>(m), over = 1 / static_cast<double>(m + 1);
      p[m + 1] = p[m] * factor * over;
      first[m + 1] = (first[m] * factor + order * p[m]) * over;
      second[m + 1] = (second[m] * factor + 2 * order * first[m]) * over;
    }
  }
};

/// The basis function of node i on a line of `order` intervals, at λ = (1 + ξ)/2, and its derivatives by ξ.
struct OnLine {
  double value, first, second;

  OnLine(const Silvester& up, const Silvester& down, std::size_t i, std::size_t rest)
      : value(up.p[i] * down.p[rest]),
        first((up.first[i] * down.p[rest] - up.p[i] * down.first[rest]) / 2),
        second((up.second[i] * down.p[rest] - 2 * up.first[i] * down.first[rest] + up.p[i] * down.second[rest]) / 4) {}
};

void add(SurfacePoint& sum, const Eigen::Vector3d& x, const std::array<double, 6>& by) {
  sum.x += by[0] * x;
  sum.du += by[1] * x;
  sum.dv += by[2] * x;
  sum.duu += by[3] * x;
  sum.duv += by[4] * x;
  sum.dvv += by[5] * x;
}

}  // namespace

ElementMap::ElementMap(Shape shape, int order, Eigen::Matrix3Xd x) : shape_(shape), order_(order), x_(std::move(x)) {}

CurvePoint ElementMap::at(double xi) const {
  const Silvester up(order_, (1 + xi) / 2), down(order_, (1 - xi) / 2);
  const auto& places = reference::lattice(Shape::Line, order_);
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  CurvePoint sum{zero, zero, zero};
  for (Eigen::Index node = 0; node < x_.cols(); ++node) {
    const auto i = static_cast<std::size_t>(places[static_cast<std::size_t>(node)][0]);
    const OnLine basis(up, down, i, static_cast<std::size_t>(order_) - i);
    sum.x += basis.value * x_.col(node);
    sum.dt += basis.first * x_.col(node);
    sum.dtt += basis.second * x_.col(node);
  }
  return sum;
}

SurfacePoint ElementMap::at(double xi, double eta) const {
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  SurfacePoint sum{zero, zero, zero, zero, zero, zero};
  const auto& places = reference::lattice(shape_, order_);
  const auto P = static_cast<std::size_t>(order_);
  const Silvester a(order_, (1 + xi) / 2), b(order_, (1 + eta) / 2);
  if (shape_ == Shape::Triangle) {
    const Silvester c(order_, -(xi + eta) / 2);
    for (Eigen::Index node = 0; node < x_.cols(); ++node) {
      const auto& place = places[static_cast<std::size_t>(node)];
      const auto i = static_cast<std::size_t>(place[0]), j = static_cast<std::size_t>(place[1]), k = P - i - j;
      const double ab = a.p[i] * b.p[j];
      const double da = a.first[i] * c.p[k] - a.p[i] * c.first[k], db = b.first[j] * c.p[k] - b.p[j] * c.first[k];
      add(sum, x_.col(node),
          {ab * c.p[k], b.p[j] * da / 2, a.p[i] * db / 2,
           b.p[j] * (a.second[i] * c.p[k] - 2 * a.first[i] * c.first[k] + a.p[i] * c.second[k]) / 4,
           (a.first[i] * db - a.p[i] * (b.first[j] * c.first[k] - b.p[j] * c.second[k])) / 4,
           a.p[i] * (b.second[j] * c.p[k] - 2 * b.first[j] * c.first[k] + b.p[j] * c.second[k]) / 4});
    }
    return sum;
  }
  const Silvester left(order_, (1 - xi) / 2), low(order_, (1 - eta) / 2);
  for (Eigen::Index node = 0; node < x_.cols(); ++node) {
    const auto& place = places[static_cast<std::size_t>(node)];
    const auto i = static_cast<std::size_t>(place[0]), j = static_cast<std::size_t>(place[1]);
    const OnLine f(a, left, i, P - i), g(b, low, j, P - j);
    add(sum, x_.col(node),
        {f.value * g.value, f.first * g.value, f.value * g.first, f.second * g.value, f.first * g.first,
         f.value * g.second});
  }
  return sum;
}

double error_over_slope(int order) {
  constexpr int kSamples = 1000;
  const bool even = order % 2 == 0;
  double largest = 0, slope = even ? 0.5 : 1;
  for (int k = 0; k <= kSamples; ++k) {
    const double s = static_cast<double>(k) / kSamples;
    double product = even ? std::abs(s - 0.5) : 1;
    for (int i = 0; i <= order; ++i) product *= std::abs(s - static_cast<double>(i) / order);
    largest = std::max(largest, product);
  }
  for (int i = 1; i <= order; ++i) slope *= static_cast<double>(i) / order;
  return largest / slope;
}

}  // namespace varimesh::geometry
