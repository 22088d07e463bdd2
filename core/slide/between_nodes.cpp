#include "core/slide/between_nodes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>

#include "core/base/index.h"
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
class EntityNodes {
 public:
  /// @param elements   the number of elements for which of() will be called
  /// @param can_start  whether Newton's method can start from parameters; called at once if there are many elements
  /// @param ranges     of the parameters
  template <class CanStart>
  EntityNodes(std::size_t elements, const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates,
              const CanStart& can_start, const std::array<geometry::Range, 2>& ranges, const Team& team)
      : nodes_(nodes), coordinates_(coordinates), ranges_(ranges) {
    if (elements == 1) {  // which has few of the nodes
      can_start_ = can_start;
      return;
    }
    known_.resize(nodes.size());
    team.for_each(static_cast<std::int32_t>(nodes.size()), kNodesPerTask,
                  [&](std::int32_t i) { known_[at(i)] = can_start(nodes[at(i)].at) ? 1 : 0; });
  }

  ElementNodes of(const EntityElement& element) const {
    const auto count = static_cast<Eigen::Index>(element.nodes.size());
    ElementNodes of{Eigen::Matrix3Xd(3, count), Eigen::Matrix2Xd(2, count), Eigen::RowVectorXd::Zero(count)};
    for (Eigen::Index k = 0; k < count; ++k) {
      const std::int32_t node = element.nodes[at(k)];
      const auto place = std::ranges::lower_bound(nodes_, node, {}, &EntityNode::node) - nodes_.begin();
      const std::array<double, 2>& parameters = nodes_[at(place)].at;
      of.x.col(k) = Eigen::Map<const Eigen::Vector3d>(&coordinates_[3 * at(node)]);
      for (std::size_t d = 0; d < 2; ++d) {
        const auto row = static_cast<Eigen::Index>(d);
        const double period = ranges_[d].period;
        of.at(row, k) = period > 0 && k > 0
                            ? parameters[d] + period * std::round((of.at(row, 0) - parameters[d]) / period)
                            : parameters[d];
      }
      if (!can_start(at(place))) of.penalty[k] = std::numeric_limits<double>::max();
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
  static constexpr std::int32_t kNodesPerTask = 64;

  bool can_start(std::size_t place) const { return known_.empty() ? can_start_(nodes_[place].at) : known_[place] != 0; }

  const std::vector<EntityNode>& nodes_;
  const std::vector<double>& coordinates_;
  std::array<geometry::Range, 2> ranges_;
  std::function<bool(const std::array<double, 2>&)> can_start_;  ///< Of a single element.
  std::vector<char> known_;                                      ///< Of more: by node.
};

/// A point of the lattice whose distance is smaller than this, over the largest so far, has no larger one around it.
constexpr double kMayBeLargest = 0.6;
/// Distances below this, over the size of the element, are not worth a finer lattice. Flat elements have only such.
constexpr double kNothing = 1e-10;
constexpr std::int32_t kElementsPerTask = 4;

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

/// What is known of an element after a look at its rule and its lattice.
struct OnLattice {
  Distances of;             ///< On the rule and on the lattice.
  Eigen::VectorXd lattice;  ///< At the points of the lattice.
};

/// The distances of one element.
/// @tparam Distance  distance(x, start) of a point
template <class Distance>
class ElementDistances {
 public:
  ElementDistances(const EntityElement& element, int order, const EntityNodes& nodes, const Distance& distance)
      : table_(entity_table(element.shape, order)), nodes_(nodes.of(element)), distance_(distance) {}

  OnLattice on_lattice() const {
    const Eigen::Index rule = table_.weights_between.size();
    OnLattice found{{}, Eigen::VectorXd(table_.between.rows() - rule)};
    found.of.elements = 1;
    for (Eigen::Index p = 0; p < rule; ++p) {
      const double one = off(table_.between, p);
      found.of.largest = std::max(found.of.largest, one);
      found.of.sum_of_squares += table_.weights_between[p] * one * one;
    }
    for (Eigen::Index p = 0; p < found.lattice.size(); ++p) found.lattice[p] = off(table_.between, rule + p);
    found.of.largest = std::max(found.of.largest, found.lattice.maxCoeff());
    return found;
  }

  /// The largest on the finer lattice, around the points of the lattice that have more than `least`.
  double on_finer(const Eigen::VectorXd& lattice, double least) const {
    const double nothing = kNothing * (nodes_.x.rowwise().maxCoeff() - nodes_.x.rowwise().minCoeff()).norm();
    double largest = 0;
    for (Eigen::Index p = 0; p < lattice.size(); ++p)
      if (lattice[p] > std::max(least, nothing) && is_highest(table_, lattice, p))
        largest = std::max(largest, climb(table_, p, lattice[p], [&](auto q) { return off(table_.finer, q); }));
    return largest;
  }

 private:
  double off(const Eigen::MatrixXd& basis, Eigen::Index p) const {
    const Eigen::Vector3d point = nodes_.x * basis.row(p).transpose();
    return distance_(point, nodes_.start(point, basis.row(p)));
  }

  const EntityTable& table_;
  const ElementNodes nodes_;
  const Distance& distance_;
};

/// @param distance  as that of ElementDistances
template <class Distance>
Distances sample(std::span<const EntityElement> elements, int order, const EntityNodes& nodes, const Distance& distance,
                 const Team& team) {
  std::vector<OnLattice> found(elements.size());
  const auto for_elements = [&](const auto& body) {
    team.for_each(static_cast<std::int32_t>(found.size()), kElementsPerTask, [&](std::int32_t e) {
      body(found[at(e)], [&] { return ElementDistances(elements[at(e)], order, nodes, distance); });
    });
  };
  for_elements([](OnLattice& one, const auto& element) { one = element().on_lattice(); });
  Distances sum;
  for (const OnLattice& one : found) sum.add(one.of);
  const double least = kMayBeLargest * sum.largest;
  for_elements([&](OnLattice& one, const auto& element) {
    if (one.of.largest > least) one.of.largest = std::max(one.of.largest, element().on_finer(one.lattice, least));
  });
  for (const OnLattice& one : found) sum.largest = std::max(sum.largest, one.of.largest);
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
                          const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates,
                          const Team& team) {
  const auto can_start = [](const std::array<double, 2>&) { return true; };
  const auto distance = [&](const Eigen::Vector3d& x, const Start& start) {
    return closest(
        start, [&](const std::array<double, 2>& from) { return geometry::closest_from(shape, x, from[0]).distance; });
  };
  const EntityNodes all(elements.size(), nodes, coordinates, can_start, {shape.range(), {}}, team);
  return sample(elements, order, all, distance, team);
}

Distances surface_distances(const geometry::SurfaceShape& shape, std::span<const EntityElement> elements, int order,
                            const std::vector<EntityNode>& nodes, const std::vector<double>& coordinates,
                            const Team& team) {
  const geometry::PieceSearch* pieces = shape.pieces();
  const auto can_start = [&](const std::array<double, 2>& from) {
    return shape.normal(shape.at(from[0], from[1]), from[0], from[1]) != Eigen::Vector3d::Zero();  // not at a pole
  };
  const auto distance = [&](const Eigen::Vector3d& x, const Start& start) {
    const auto closest_from = [&](const std::array<double, 2>& from) {
      return geometry::closest_from(shape, x, from[0], from[1]).distance;
    };
    if (pieces == nullptr) return closest(start, closest_from);
    // The parameters jump between pieces.
    const double near = closest_from(start.nearest);
    const bool is_sure = near < kSuspicious * (x - shape.at(start.nearest[0], start.nearest[1]).x).norm();
    return !pieces->may_fold() || is_sure ? near : std::min(near, pieces->closest(x).distance);
  };
  const EntityNodes all(elements.size(), nodes, coordinates, can_start, {shape.u_range(), shape.v_range()}, team);
  return sample(elements, order, all, distance, team);
}

}  // namespace varimesh::detail
