#include "core/slide/between_nodes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/geometry/closest_point.h"

namespace varimesh::detail {
namespace {

/// A point between nodes that is farther from the pieces around than this, over its distance from the node, may belong
/// to a piece that is folded over: then all pieces are searched.
constexpr double kSuspicious = 0.01;

/// Calls distance(x, parameters of the nearest node from which Newton's method can start) for each sample.
/// @param can_start  whether it can start from these parameters
template <class Distance, class CanStart>
Distances sample(std::span<const EntityElement> elements, int order, const std::vector<EntityNode>& nodes,
                 const std::vector<double>& coordinates, const Distance& distance, const CanStart& can_start) {
  Distances sum;
  for (const EntityElement& element : elements) {
    const EntityTable& table = entity_table(element.shape, order);
    Eigen::Matrix<double, 3, Eigen::Dynamic> x(3, static_cast<Eigen::Index>(element.nodes.size()));
    for (std::size_t k = 0; k < element.nodes.size(); ++k)
      x.col(static_cast<Eigen::Index>(k)) =
          Eigen::Map<const Eigen::Vector3d>(&coordinates[3 * static_cast<std::size_t>(element.nodes[k])]);
    std::vector<std::array<double, 2>> at;
    Eigen::RowVectorXd penalty = Eigen::RowVectorXd::Zero(x.cols());  // puts nodes behind those that can start
    for (Eigen::Index k = 0; k < x.cols(); ++k) {
      const std::int32_t node = element.nodes[static_cast<std::size_t>(k)];
      at.push_back(std::ranges::lower_bound(nodes, node, {}, &EntityNode::node)->at);
      if (!can_start(at.back())) penalty[k] = std::numeric_limits<double>::max();
    }
    for (Eigen::Index p = 0; p < table.between.rows(); ++p) {
      const Eigen::Vector3d point = x * table.between.row(p).transpose();
      Eigen::Index nearest = 0;
      ((x.colwise() - point).colwise().squaredNorm() + penalty).minCoeff(&nearest);
      const double off = distance(point, at[static_cast<std::size_t>(nearest)]);
      sum.largest = std::max(sum.largest, off);
      sum.sum_of_squares += off * off;
      sum.samples += 1;
    }
  }
  return sum;
}

}  // namespace

double Distances::rms() const { return samples > 0 ? std::sqrt(sum_of_squares / samples) : 0; }

void Distances::add(const Distances& other) {
  largest = std::max(largest, other.largest);
  sum_of_squares += other.sum_of_squares;
  samples += other.samples;
}

Distances curve_distances(const geometry::CurveShape& shape, std::span<const EntityElement> elements, int order,
                          const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates) {
  return sample(
      elements, order, nodes, coordinates,
      [&](const Eigen::Vector3d& x, const std::array<double, 2>& guess) {
        return geometry::closest_from(shape, x, guess[0]).distance;
      },
      [](const std::array<double, 2>&) { return true; });
}

Distances surface_distances(const geometry::SurfaceShape& shape, std::span<const EntityElement> elements, int order,
                            const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates) {
  return sample(
      elements, order, nodes, coordinates,
      [&](const Eigen::Vector3d& x, const std::array<double, 2>& guess) {
        const double near = geometry::closest_from(shape, x, guess[0], guess[1]).distance;
        const geometry::PieceSearch* pieces = shape.pieces();
        if (pieces == nullptr || !pieces->may_fold() ||
            near < kSuspicious * (x - shape.at(guess[0], guess[1]).x).norm())
          return near;
        return std::min(near, pieces->closest(x).distance);
      },
      [&](const std::array<double, 2>& from) {
        return shape.normal(shape.at(from[0], from[1]), from[0], from[1]) != Eigen::Vector3d::Zero();  // not at a pole
      });
}

}  // namespace varimesh::detail
