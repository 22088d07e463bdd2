// Where layers cut an edge that rises from a wall. Internal to core/layers.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/options/options.h"

namespace varimesh::detail {

/// How far the points of an edge are from its beginning: a polynomial of the edge's parameter, 0 … 1.
class EdgeHeight {
 public:
  /// @param nodes   of the edge, equispaced in its parameter, from its beginning to its end
  /// @param normal  the unit normal of the wall at the beginning. If the edge rises too obliquely from the wall, or
  ///                not steadily, its own direction counts instead.
  /// @param least   the edge rises too obliquely if the cosine between it and the normal is less
  EdgeHeight(const std::vector<Eigen::Vector3d>& nodes, const Eigen::Vector3d& normal, double least = 0.5);
  /// An edge whose height is its parameter, times its total height.
  explicit EdgeHeight(double total) : at_node_{0, total}, is_linear_(true) {}

  /// The height of the whole edge.
  double total() const { return at_node_.back(); }
  /// The parameter of the point at a height, 0 … total().
  double parameter(double height) const;

 private:
  double height(double parameter) const;

  std::vector<double> at_node_;
  bool is_linear_ = false;
};

/// The parts of an edge, from its beginning to its end, and how the nodes of cells are spaced in each.
class EdgeCut {
 public:
  /// @param heights  of the parts; they add up to the edge's height
  /// @param growth   by part: how much the parts grow across it
  /// @param size     the width of the cells at the wall, in the unit of the heights
  EdgeCut(EdgeHeight edge, std::vector<double> heights, std::vector<double> growth, double size, int order,
          LayerSpacing spacing);

  int parts() const { return static_cast<int>(heights_.size()); }
  /// The parameter on the edge of the point that is the share ξ of the nodes above the lower end of a part.
  double parameter(int part, double xi) const;

 private:
  double compute(int part, double xi) const;

  EdgeHeight edge_;
  std::vector<double> at_node_;                   ///< The parameters of the nodes of the parts.
  std::vector<double> heights_, growth_, below_;  ///< below_: the height of the lower end of each part.
  double size_;
  int order_;
  LayerSpacing spacing_;
};

}  // namespace varimesh::detail
