#include "core/layers/error/layer_error.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/layers/columns.h"
#include "core/layers/error/wall_distance.h"
#include "core/layers/facet_table.h"
#include "core/layers/placement.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

using detail::LayerCell;

/// The largest number of thicknesses δ. With 40, the last is 2³⁹ times the first.
constexpr int kMostThicknesses = 40;
constexpr int kMostProfiles = 2 * kMostThicknesses;
/// A profile that has fallen to this at all nodes of a cell is 0 there.
constexpr double kGone = 1e-9;
constexpr std::size_t kNodesAtOnce = 64;  ///< That a thread takes.
/// Cells are added up in their order within a block and then by block, so the sums do not depend on the threads.
constexpr std::size_t kCellsPerSum = 32;

/// The basis of a shape at points of quadrature.
struct Basis {
  Eigen::MatrixXd values;                  ///< Points × nodes.
  std::vector<Eigen::MatrixXd> gradients;  ///< The same for each reference direction.
  Eigen::VectorXd weights;
};

Basis basis_of(Shape shape, int order, int dimension) {
  const reference::Quadrature rule = reference::quadrature(shape, order, 2 * order + 2);
  return {reference::basis_values(shape, order, reference::NodeSet::Equispaced, dimension, rule.points),
          reference::basis_gradients(shape, order, reference::NodeSet::Equispaced, dimension, rule.points),
          rule.weights};
}

/// A profile that decays from the wall, at s = n/δ, and its derivative by s.
struct Decay {
  double value, slope;
};
/// exp(−s) for even numbers of a profile, erfc s for odd ones.
Decay decay(int number, double s) {
  if (number % 2 == 0) return {std::exp(-s), -std::exp(-s)};
  return {std::erfc(s), -2 * std::numbers::inv_sqrtpi * std::exp(-s * s)};
}

/// Of some cells, by profile: δ ∫|∇(u − I u)|² and δ ∫|∇u|².
struct Sums {
  std::array<double, kMostProfiles> missed{}, all{};
  bool is_valid = true;
};

class Measurer {
 public:
  /// The columns and the layers are those of `came`, which has the same elements.
  Measurer(const HighOrderMesh& mesh, const HighOrderMesh& came, const detail::Columns& columns,
           std::vector<LayerCell> layers)
      : mesh_(mesh),
        came_(came),
        columns_(columns),
        layers_(std::move(layers)),
        wall_(mesh, columns),
        cells_(mesh, mesh.dimension) {}

  std::optional<LayerError> measure(const Team& team) {
    find_profiles(distances(came_, true, team));
    distance_ = distances(mesh_, false, team);
    for (const LayerCell& layer : layers_) {
      const Shape shape = cells_.shape(at(layer.cell));
      auto& basis = bases_[static_cast<std::size_t>(shape)];
      if (basis.weights.size() == 0) basis = basis_of(shape, mesh_.order, mesh_.dimension);
    }
    std::vector<Sums> sums((layers_.size() + kCellsPerSum - 1) / kCellsPerSum);
    team.run([&] {
      team.for_ranges(sums.size(), 1, [&](std::size_t begin, std::size_t end) {
        for (std::size_t block = begin; block < end; ++block)
          for (std::size_t i = block * kCellsPerSum; i < std::min((block + 1) * kCellsPerSum, layers_.size()); ++i) {
            team.look();
            add(layers_[i], sums[block]);
          }
      });
    });
    return total(sums);
  }

 private:
  /// By node: the distance of the layers' nodes, or of their vertices only, from the wall above which they lie; 0 for
  /// other nodes. Both meshes have the same wall.
  std::vector<double> distances(const HighOrderMesh& mesh, bool only_vertices, const Team& team) const {
    constexpr std::int32_t kNone = -1;
    std::vector<std::int32_t> facet_of(mesh.node_count(), kNone), nodes;
    for (const LayerCell& layer : layers_) {
      const std::span<const std::int32_t> all = cells_.nodes(at(layer.cell));
      const int vertices = reference::info(cells_.shape(at(layer.cell))).vertices;
      for (const std::int32_t node : only_vertices ? all.first(at(vertices)) : all) {
        if (facet_of[at(node)] == kNone) nodes.push_back(node);
        facet_of[at(node)] = layer.facet;
      }
    }
    std::vector<double> found(mesh.node_count(), 0);
    team.run([&] {
      team.for_ranges(nodes.size(), kNodesAtOnce, [&](std::size_t begin, std::size_t end) {
        for (std::size_t i = begin; i < end; ++i)
          found[at(nodes[i])] = wall_.distance(detail::point(mesh, nodes[i]), facet_of[at(nodes[i])]).value;
      });
    });
    return found;
  }

  /// The thickness of the first profile above each facet, and the number of thicknesses, from the distances of the
  /// vertices in the mesh as it came.
  void find_profiles(const std::vector<double>& distance) {
    const std::size_t facets = columns_.facets.size();
    std::vector<double> highest(facets, 0);
    first_.assign(facets, 0);
    count_.assign(facets, 0);
    for (const LayerCell& layer : layers_)
      for (const std::int32_t node : cells_.nodes(at(layer.cell)))
        highest[at(layer.facet)] = std::max(highest[at(layer.facet)], distance[at(node)]);
    for (std::size_t facet = 0; facet < facets; ++facet) {
      const detail::WallFacet& wall = columns_.facets[facet];
      const int corners = reference::info(wall.shape).vertices;
      for (int v = 0; v < corners; ++v) {
        const auto& column = columns_.vertices[at(columns_.column_of[at(wall.nodes[at(v)])])];
        if (column.size() > 1) first_[facet] += distance[at(column[1])] / corners;
      }
      if (!(first_[facet] > 0)) continue;
      // Rounding must not decide whether the last profile is as thick as the layers.
      const double doublings = std::log2(highest[facet] / first_[facet] * (1 + 1e-9));
      if (doublings >= 0) count_[facet] = std::min(static_cast<int>(doublings) + 1, kMostThicknesses);
    }
  }

  /// Adds what a cell has of the sums.
  void add(const LayerCell& layer, Sums& sums) const {
    const std::span<const std::int32_t> nodes = cells_.nodes(at(layer.cell));
    const Basis& basis = bases_[static_cast<std::size_t>(cells_.shape(at(layer.cell)))];
    const auto count = static_cast<Eigen::Index>(nodes.size());
    const int d = mesh_.dimension;
    Eigen::MatrixXd x(count, d);
    Eigen::VectorXd n(count);
    for (Eigen::Index k = 0; k < count; ++k) {
      x.row(k) = (detail::point(mesh_, nodes[at(k)]) - detail::point(mesh_, nodes[0])).head(d);
      n[k] = distance_[at(nodes[at(k)])];
    }
    const auto profiles = profiles_above(layer.facet, n.minCoeff());
    if (profiles.empty()) return;
    Eigen::MatrixXd u(count, static_cast<Eigen::Index>(profiles.size()));
    for (Eigen::Index k = 0; k < u.cols(); ++k)
      u.col(k) = n.unaryExpr([&, profile = profiles[at(k)]](double distance) {
        return decay(profile.number, distance / profile.delta).value;
      });
    const Eigen::MatrixXd points = basis.values * x;      // points × d, from the first node
    std::vector<Eigen::MatrixXd> jacobian, interpolated;  // by reference direction: points × d, points × profiles
    for (const Eigen::MatrixXd& gradient : basis.gradients) {
      jacobian.emplace_back(gradient * x);
      interpolated.emplace_back(gradient * u);
    }
    Eigen::MatrixXd missed(d, u.cols());  // ∇(u − I u) by reference direction
    Eigen::VectorXd weights(u.cols());
    double sign = 0;
    for (Eigen::Index q = 0; q < basis.weights.size(); ++q) {
      Eigen::MatrixXd frame(d, d);  // ∂x_i/∂ξ_c at (c, i)
      for (int c = 0; c < d; ++c) frame.row(c) = jacobian[at(c)].row(q);
      const double determinant = frame.determinant();
      if (sign == 0) sign = determinant;
      sums.is_valid = sums.is_valid && sign * determinant > 0;
      if (!sums.is_valid) return;
      // Thin cells have a condition of 1e7 and more, which products of the frame with itself would square.
      const Eigen::PartialPivLU<Eigen::MatrixXd> gradient(frame);
      Eigen::Vector3d point = detail::point(mesh_, nodes[0]);
      point.head(d) += points.row(q).transpose();
      const detail::WallDistance::Distance from_wall = wall_.distance(point, layer.facet);
      const Eigen::VectorXd slope = frame * from_wall.gradient.head(d);  // of n, by reference direction
      for (std::size_t k = 0; k < profiles.size(); ++k) {
        const auto [delta, number] = profiles[k];
        const double steep = decay(number, from_wall.value / delta).slope / delta;
        const double weight = delta * basis.weights[q] * std::abs(determinant);
        const auto column = static_cast<Eigen::Index>(k);
        for (int c = 0; c < d; ++c) missed(c, column) = steep * slope[c] - interpolated[at(c)](q, column);
        weights[column] = weight;
        sums.all[at(number)] += weight * steep * steep;
      }
      const Eigen::RowVectorXd squares = gradient.solve(missed).colwise().squaredNorm();
      for (std::size_t k = 0; k < profiles.size(); ++k)
        sums.missed[at(profiles[k].number)] +=
            weights[static_cast<Eigen::Index>(k)] * squares[static_cast<Eigen::Index>(k)];
    }
  }

  struct Profile {
    double delta;
    int number;
  };
  /// The profiles above a facet that have not gone where the distance from the wall is at least `nearest`.
  std::vector<Profile> profiles_above(std::int32_t facet, double nearest) const {
    std::vector<Profile> profiles;
    for (int number = 0; number < 2 * count_[at(facet)] - 1; ++number) {
      const double delta = std::ldexp(first_[at(facet)], (number + 1) / 2);
      if (decay(number, nearest / delta).value > kGone) profiles.push_back({delta, number});
    }
    return profiles;
  }

  std::optional<LayerError> total(const std::vector<Sums>& sums) const {
    std::array<double, kMostProfiles> missed{}, all{};
    for (const Sums& of_cell : sums) {
      if (!of_cell.is_valid) return std::nullopt;
      for (std::size_t k = 0; k < kMostProfiles; ++k) {
        missed[k] += of_cell.missed[k];
        all[k] += of_cell.all[k];
      }
    }
    LayerError found;
    found.cells = static_cast<std::int64_t>(layers_.size());
    double squares = 0;  // of the exponentials
    for (std::size_t k = 0; k < kMostProfiles && all[k] > 0; ++k) {
      found.of_profiles.push_back(std::sqrt(missed[k] / all[k]));
      if (k % 2 == 0) squares += missed[k] / all[k];
    }
    if (found.of_profiles.empty()) return std::nullopt;
    found.error = std::sqrt(squares / static_cast<double>((found.of_profiles.size() + 1) / 2));
    return found;
  }

  const HighOrderMesh& mesh_;
  const HighOrderMesh& came_;
  const detail::Columns& columns_;
  const std::vector<LayerCell> layers_;
  const detail::WallDistance wall_;
  const Cells cells_;
  std::array<Basis, kShapes> bases_;  ///< By shape; empty: no layer has it.
  std::vector<double> distance_;      ///< By node; 0 if it is in no layer.
  std::vector<double> first_;         ///< By facet of the walls: h; 0: it has no layers.
  std::vector<int> count_;            ///< By facet: of thicknesses.
};

}  // namespace

std::optional<LayerError> layer_error(const HighOrderMesh& mesh, const Facets& facets, const Team& team,
                                      const HighOrderMesh* as_it_came) {
  const HighOrderMesh& came = as_it_came != nullptr ? *as_it_came : mesh;
  detail::Columns columns = detail::find_columns(came, facets, detail::Walls::Curved);
  if (columns.empty()) columns = detail::find_columns(came, facets, detail::Walls::All);
  if (columns.empty()) return std::nullopt;
  const std::vector<bool> none(came.node_count(), false);
  detail::Placement placement = detail::place_in_layers(came, columns, LayerSpacing::Keep, none);
  if (placement.cells.empty()) return std::nullopt;
  return Measurer(mesh, came, columns, std::move(placement.cells)).measure(team);
}

}  // namespace varimesh
