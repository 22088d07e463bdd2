#include "core/curve/blend.h"

#include <array>
#include <map>
#include <utility>

#include "core/mesh/changes/simplex_blend.h"
#include "core/reference/cache.h"
#include "core/reference/nodes.h"

namespace varimesh::detail {
namespace {

using Lattice = std::array<std::int8_t, 3>;

/// Fills the rows of one shape.
class Blending {
 public:
  Blending(Shape shape, int order) : shape_(shape), order_(order), lattice_(reference::lattice(shape, order)) {
    for (std::size_t k = 0; k < lattice_.size(); ++k) place_[lattice_[k]] = static_cast<Eigen::Index>(k);
  }

  InnerBlend make() {
    const int dimension = reference::info(shape_).dimension;
    const auto& places = reference::node_places(shape_, order_);
    for (std::size_t k = 0; k < places.size(); ++k)
      if (places[k].dimension == dimension) result_.inner.push_back(static_cast<int>(k));
    if (shape_ == Shape::Triangle || shape_ == Shape::Tetrahedron) {
      const SimplexBlend& simplex = simplex_blend(shape_, order_);
      result_.weights = dimension == 2 ? simplex.on_face[0] : simplex.in_cell;
      return std::move(result_);
    }
    result_.weights.setZero(static_cast<Eigen::Index>(result_.inner.size()),
                            static_cast<Eigen::Index>(lattice_.size()));
    for (std::size_t row = 0; row < result_.inner.size(); ++row) {
      row_ = static_cast<Eigen::Index>(row);
      const Lattice& at = lattice_[static_cast<std::size_t>(result_.inner[row])];
      if (shape_ == Shape::Quadrilateral) tensor(at, 2);
      if (shape_ == Shape::Prism) between(at, 2, 1);
      if (shape_ == Shape::Hexahedron) tensor(at, 3);
    }
    for (int vertex = 0; vertex < reference::info(shape_).vertices; ++vertex) result_.weights.col(vertex).setZero();
    return std::move(result_);
  }

 private:
  double& weight(const Lattice& at) { return result_.weights(row_, place_.at(at)); }

  /// Adds `factor` times the linear blend between the two ends in one direction.
  void between(Lattice at, std::size_t direction, double factor) {
    const double part = static_cast<double>(at[direction]) / order_;
    at[direction] = 0;
    weight(at) += factor * (1 - part);
    at[direction] = static_cast<std::int8_t>(order_);
    weight(at) += factor * part;
  }

  /// The Boolean sum of the blends in all directions; the corners do not count.
  void tensor(const Lattice& at, std::size_t dimension) {
    for (std::size_t a = 0; a < dimension; ++a) between(at, a, 1);
    if (dimension != 3) return;
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = a + 1; b < 3; ++b) {
        const double part = static_cast<double>(at[a]) / order_;
        Lattice end = at;
        end[a] = 0;
        between(end, b, -(1 - part));
        end[a] = static_cast<std::int8_t>(order_);
        between(end, b, -part);
      }
  }

  Shape shape_;
  int order_;
  const std::vector<Lattice>& lattice_;
  std::map<Lattice, Eigen::Index> place_;
  InnerBlend result_;
  Eigen::Index row_ = 0;
};

}  // namespace

const InnerBlend& inner_blend(Shape shape, int order) {
  static reference::Cache<std::pair<Shape, int>, InnerBlend> cache;
  return cache.get({shape, order}, [&] { return Blending(shape, order).make(); });
}

void move_inner(const InnerBlend& inner, const std::int32_t* nodes, const std::vector<double>& straight,
                std::vector<double>& coordinates) {
  const Eigen::Index count = inner.weights.cols();
  Eigen::Matrix<double, Eigen::Dynamic, 3> shift(count, 3);
  for (Eigen::Index k = 0; k < count; ++k)
    for (Eigen::Index c = 0; c < 3; ++c) {
      const std::size_t at = 3 * static_cast<std::size_t>(nodes[k]) + static_cast<std::size_t>(c);
      shift(k, c) = coordinates[at] - straight[at];
    }
  for (std::size_t i = 0; i < inner.inner.size(); ++i) {
    const Eigen::RowVector3d by = inner.weights.row(static_cast<Eigen::Index>(i)) * shift;
    for (std::size_t c = 0; c < 3; ++c) {
      const std::size_t at = 3 * static_cast<std::size_t>(nodes[inner.inner[i]]) + c;
      coordinates[at] = straight[at] + by[static_cast<Eigen::Index>(c)];
    }
  }
}

}  // namespace varimesh::detail
