#include "core/layers/split/edge_cut.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/index.h"
#include "core/layers/spacing.h"

namespace varimesh::detail {
namespace {

using Vector = Eigen::Vector3d;

std::vector<double> heights_along(const std::vector<Vector>& nodes, const Vector& direction) {
  std::vector<double> heights;
  for (const Vector& node : nodes) heights.push_back(direction.dot(node - nodes.front()));
  return heights;
}

bool increases(const std::vector<double>& heights) {
  return std::ranges::adjacent_find(heights, [](double a, double b) { return !(b > a); }) == heights.end();
}

}  // namespace

EdgeHeight::EdgeHeight(const std::vector<Vector>& nodes, const Vector& normal, double least) {
  const Vector chord = nodes.back() - nodes.front();
  at_node_ = heights_along(nodes, normal);
  if (total() < least * chord.norm() || !increases(at_node_)) at_node_ = heights_along(nodes, chord.normalized());
  const double step = total() / static_cast<double>(nodes.size() - 1);
  is_linear_ = true;
  for (std::size_t node = 0; node < nodes.size(); ++node)
    if (std::abs(at_node_[node] - step * static_cast<double>(node)) > 1e-13 * total()) is_linear_ = false;
}

double EdgeHeight::height(double parameter) const {
  const int order = static_cast<int>(at_node_.size()) - 1;
  double sum = 0;
  for (int i = 0; i <= order; ++i) {
    double value = at_node_[at(i)];
    for (int j = 0; j <= order; ++j)
      if (j != i) value *= (order * parameter - j) / (i - j);
    sum += value;
  }
  return sum;
}

double EdgeHeight::parameter(double height) const {
  if (height <= 0) return 0;
  if (height >= total()) return 1;
  if (is_linear_) return height / total();
  double low = 0, high = 1;
  while (true) {
    const double middle = (low + high) / 2;
    if (middle <= low || middle >= high) return middle;
    (this->height(middle) < height ? low : high) = middle;
  }
}

EdgeCut::EdgeCut(EdgeHeight edge, std::vector<double> heights, std::vector<double> growth, double size, int order,
                 LayerSpacing spacing)
    : edge_(std::move(edge)),
      heights_(std::move(heights)),
      growth_(std::move(growth)),
      size_(size),
      order_(order),
      spacing_(spacing) {
  double sum = 0;
  for (const double height : heights_) below_.push_back(std::exchange(sum, sum + height));
  for (int part = 0; part < parts(); ++part)
    for (int node = 0; node < order; ++node) at_node_.push_back(compute(part, static_cast<double>(node) / order));
  at_node_.push_back(1);
}

double EdgeCut::parameter(int part, double xi) const {
  const double node = order_ * xi;
  const int nearest = static_cast<int>(node + 0.5);
  return std::abs(node - nearest) < 1e-9 ? at_node_[at(part * order_ + nearest)] : compute(part, xi);
}

double EdgeCut::compute(int part, double xi) const {
  const double height = heights_[at(part)];
  const double share =
      spacing_ == LayerSpacing::Graded ? graded_share(xi, growth_[at(part)], height, size_, order_) : xi;
  return edge_.parameter(below_[at(part)] + share * height);
}

}  // namespace varimesh::detail
