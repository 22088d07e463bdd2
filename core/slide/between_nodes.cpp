#include "core/slide/between_nodes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "core/geometry/closest_point.h"

namespace varimesh::detail {
namespace {

/// A point between nodes that is farther from the pieces around than this, over its distance from the node, may belong
/// to a piece that is folded over: then all pieces are searched.
constexpr double kSuspicious = 0.01;

/// Where Newton's method may start for a point of an element.
struct Start {
  std::array<double, 2> nearest;  ///< The parameters of the nearest node from which it can start.
  double to_nearest;              ///< The distance to this node.
  /// The parameters of the point itself, interpolated from those of the nodes. Nothing if these do not allow it.
  std::optional<std::array<double, 2>> between;
};

/// The nodes of one element.
struct ElementNodes {
  Eigen::Matrix3Xd x;            ///< Positions.
  Eigen::Matrix2Xd at;           ///< Parameters, all in the same period.
  Eigen::RowVectorXd penalty;    ///< Puts nodes behind those from which Newton's method can start.
  bool may_interpolate = false;  ///< It can start from all, and the parameters spread over a small part of a period.

  Start start(const Eigen::Vector3d& point, const Eigen::MatrixXd::ConstRowXpr& basis) const {
    Eigen::Index nearest = 0;
    ((x.colwise() - point).colwise().squaredNorm() + penalty).minCoeff(&nearest);
    Start start{{at(0, nearest), at(1, nearest)}, (x.col(nearest) - point).norm(), {}};
    if (!may_interpolate) return start;
    const Eigen::Vector2d between = at * basis.transpose();
    start.between = {between[0], between[1]};
    return start;
  }
};

/// All nodes of an entity.
template <class CanStart>
class EntityNodes {
 public:
  /// @param elements   the number of elements for which of() will be called
  /// @param can_start  whether Newton's method can start from parameters
  /// @param ranges     of the parameters
  EntityNodes(std::size_t elements, const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates,
              const CanStart& can_start, const std::array<geometry::Range, 2>& ranges)
      : nodes_(nodes),
        coordinates_(coordinates),
        can_start_(can_start),
        ranges_(ranges),
        known_(elements > 1 ? nodes.size() : 0) {}

  ElementNodes of(const EntityElement& element) {
    const auto count = static_cast<Eigen::Index>(element.nodes.size());
    ElementNodes of{Eigen::Matrix3Xd(3, count), Eigen::Matrix2Xd(2, count), Eigen::RowVectorXd::Zero(count)};
    for (Eigen::Index k = 0; k < count; ++k) {
      const std::int32_t node = element.nodes[static_cast<std::size_t>(k)];
      const auto place = std::ranges::lower_bound(nodes_, node, {}, &EntityNode::node) - nodes_.begin();
      const std::array<double, 2>& at = nodes_[static_cast<std::size_t>(place)].at;
      of.x.col(k) = Eigen::Map<const Eigen::Vector3d>(&coordinates_[3 * static_cast<std::size_t>(node)]);
      for (std::size_t d = 0; d < 2; ++d) {
        const auto row = static_cast<Eigen::Index>(d);
        const double period = ranges_[d].period;
        of.at(row, k) = period > 0 && k > 0 ? at[d] + period * std::round((of.at(row, 0) - at[d]) / period) : at[d];
      }
      if (!can_start(static_cast<std::size_t>(place))) of.penalty[k] = std::numeric_limits<double>::max();
    }
    of.may_interpolate = !(of.penalty.maxCoeff() > 0);
    for (std::size_t d = 0; d < 2; ++d) {
      const auto row = of.at.row(static_cast<Eigen::Index>(d));
      if (ranges_[d].period > 0 && row.maxCoeff() - row.minCoeff() > 0.25 * ranges_[d].period)
        of.may_interpolate = false;
    }
    return of;
  }

 private:
  bool can_start(std::size_t place) {
    if (known_.empty()) return can_start_(nodes_[place].at);
    std::optional<bool>& known = known_[place];
    if (!known) known = can_start_(nodes_[place].at);
    return *known;
  }

  const std::vector<EntityNode>& nodes_;
  const std::vector<double>& coordinates_;
  const CanStart& can_start_;
  std::array<geometry::Range, 2> ranges_;
  /// By node: to find it takes an evaluation of the shape. Empty for a single element, which has few of the nodes.
  std::vector<std::optional<bool>> known_;
};

/// A point of the lattice whose distance is smaller than this, over the largest so far, has no larger one around it.
constexpr double kMayBeLargest = 0.6;
/// Distances below this, over the size of the element, are not worth a finer lattice. Flat elements have only such.
constexpr double kNothing = 1e-10;

/// Whether no point beside this one on the lattice has a larger distance.
bool is_highest(const EntityTable& table, const Eigen::VectorXd& lattice, Eigen::Index p) {
  return std::ranges::all_of(table.beside[static_cast<std::size_t>(p)],
                             [&](Eigen::Index q) { return lattice[q] <= lattice[p]; });
}

/// The largest distance within one interval of a point of the lattice: goes up from point to point of the finer one.
/// @param distance  at a point of the finer lattice
template <class Distance>
double climb(const EntityTable& table, Eigen::Index p, double largest, const Distance& distance) {
  const std::vector<Eigen::Index>& around = table.around[static_cast<std::size_t>(p)];
  std::vector<char> seen(around.size(), 0);
  Eigen::Index top = around.front();
  for (Eigen::Index from = -1; from != top;) {
    from = top;
    for (std::size_t k = 1; k < around.size(); ++k) {
      const bool is_beside =
          (table.finer_at.row(around[k]) - table.finer_at.row(from)).cwiseAbs().maxCoeff() < table.finer_step;
      if (seen[k] != 0 || !is_beside) continue;
      seen[k] = 1;
      if (const double one = distance(around[k]); one > largest) {
        largest = one;
        top = around[k];
      }
    }
  }
  return largest;
}

/// Calls distance(x, start) for each sample.
template <class CanStart, class Distance>
Distances sample(std::span<const EntityElement> elements, int order, EntityNodes<CanStart> nodes,
                 const Distance& distance) {
  Distances sum;
  for (const EntityElement& element : elements) {
    const EntityTable& table = entity_table(element.shape, order);
    const ElementNodes own = nodes.of(element);
    const auto off = [&](const Eigen::MatrixXd& basis, Eigen::Index p) {
      const Eigen::Vector3d point = own.x * basis.row(p).transpose();
      return distance(point, own.start(point, basis.row(p)));
    };
    const Eigen::Index rule = table.weights_between.size();
    for (Eigen::Index p = 0; p < rule; ++p) {
      const double one = off(table.between, p);
      sum.largest = std::max(sum.largest, one);
      sum.sum_of_squares += table.weights_between[p] * one * one;
    }
    Eigen::VectorXd lattice(table.between.rows() - rule);
    for (Eigen::Index p = 0; p < lattice.size(); ++p) lattice[p] = off(table.between, rule + p);
    sum.largest = std::max(sum.largest, lattice.maxCoeff());
    const double nothing = kNothing * (own.x.rowwise().maxCoeff() - own.x.rowwise().minCoeff()).norm();
    for (Eigen::Index p = 0; p < lattice.size(); ++p)
      if (lattice[p] > std::max(kMayBeLargest * sum.largest, nothing) && is_highest(table, lattice, p))
        sum.largest = std::max(sum.largest, climb(table, p, lattice[p], [&](auto q) { return off(table.finer, q); }));
    sum.elements += 1;
  }
  return sum;
}

/// A foot that is nearer than this, over the distance to the nearest node, is not one of another part of the shape.
constexpr double kSure = 0.05;

/// The distance to which Newton's method leads from `start.between`, if that is sure to be the smallest one. Otherwise
/// it starts from the nearest node too.
/// @param closest_from  the distance to which parameters lead
template <class ClosestFrom>
double closest(const Start& start, const ClosestFrom& closest_from) {
  if (!start.between) return closest_from(start.nearest);
  const double off = closest_from(*start.between);
  return off <= kSure * start.to_nearest ? off : std::min(off, closest_from(start.nearest));
}

}  // namespace

double Distances::rms() const { return elements > 0 ? std::sqrt(sum_of_squares / elements) : 0; }

void Distances::add(const Distances& other) {
  largest = std::max(largest, other.largest);
  sum_of_squares += other.sum_of_squares;
  elements += other.elements;
}

Distances curve_distances(const geometry::CurveShape& shape, std::span<const EntityElement> elements, int order,
                          const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates) {
  const auto can_start = [](const std::array<double, 2>&) { return true; };
  return sample(elements, order, EntityNodes(elements.size(), nodes, coordinates, can_start, {shape.range(), {}}),
                [&](const Eigen::Vector3d& x, const Start& start) {
                  return closest(start, [&](const std::array<double, 2>& from) {
                    return geometry::closest_from(shape, x, from[0]).distance;
                  });
                });
}

Distances surface_distances(const geometry::SurfaceShape& shape, std::span<const EntityElement> elements, int order,
                            const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates) {
  const geometry::PieceSearch* pieces = shape.pieces();
  const auto can_start = [&](const std::array<double, 2>& from) {
    return shape.normal(shape.at(from[0], from[1]), from[0], from[1]) != Eigen::Vector3d::Zero();  // not at a pole
  };
  return sample(elements, order,
                EntityNodes(elements.size(), nodes, coordinates, can_start, {shape.u_range(), shape.v_range()}),
                [&](const Eigen::Vector3d& x, const Start& start) {
                  const auto closest_from = [&](const std::array<double, 2>& from) {
                    return geometry::closest_from(shape, x, from[0], from[1]).distance;
                  };
                  if (pieces == nullptr) return closest(start, closest_from);
                  // The parameters jump between pieces.
                  const double near = closest_from(start.nearest);
                  const bool is_sure = near < kSuspicious * (x - shape.at(start.nearest[0], start.nearest[1]).x).norm();
                  return !pieces->may_fold() || is_sure ? near : std::min(near, pieces->closest(x).distance);
                });
}

}  // namespace varimesh::detail
