// The samples at which a patch looks at its cells, and the kernels that differentiate maps there.
#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <utility>

#include "core/base/aligned.h"
#include "core/reference/nodes.h"
#include "core/reference/shape.h"

namespace varimesh {

/// Derivatives of the basis of one shape and order (equispaced nodes) at some points. Arrays by point have
/// padded_points() numbers, a multiple of kTile; what follows the last point is 0 or has no meaning.
class SampleTable {
 public:
  static constexpr std::size_t kTile = 8;

  SampleTable(Shape shape, int order, int dimension, const reference::Points& points);

  std::size_t dimension() const { return dimension_; }
  std::size_t nodes() const { return nodes_; }
  std::size_t points() const { return points_; }
  std::size_t padded_points() const { return tiles() * kTile; }

  /// ∂φ_n/∂ξ_k at a point.
  double gradient(std::size_t point, std::size_t n, std::size_t k) const {
    return gradients_[((point / kTile * nodes_ + n) * dimension_ + k) * kTile + point % kTile];
  }
  /// out[k][c][point] = Σ_n ∂φ_n/∂ξ_k x[n][c]
  void differentiate(const double* x, double* out) const;
  /// out[n][c] = Σ_points Σ_k ∂φ_n/∂ξ_k weights[k][c][point]; `weights` are 0 after the last point.
  void add_up(const double* weights, double* out) const;

 private:
  std::size_t tiles() const { return (points_ + kTile - 1) / kTile; }

  std::size_t dimension_, nodes_, points_;
  AlignedVector<double> gradients_;  ///< [tile][node][direction][point in the tile]
};

/// The tables of the cells of one mesh, each made when it is first asked for. Ask for it before threads do.
class SampleTables {
 public:
  static constexpr int kMostHalvings = 2;

  SampleTables(int order, int dimension) : order_(order), dimension_(dimension) {}

  /// At the uniform lattice of 2 P + 2 intervals, with its spacing halved this many times; null if the table would be
  /// too large.
  const SampleTable* table(Shape shape, int halvings = 0);

 private:
  int order_, dimension_;
  std::map<std::pair<Shape, int>, std::optional<SampleTable>> tables_;
};

}  // namespace varimesh
