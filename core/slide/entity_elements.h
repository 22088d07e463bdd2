// The elements of a mesh on one curve or surface of a geometry, and the tables of their energy. Internal to core/slide.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "core/association/association.h"

namespace varimesh::detail {

/// An element of dimension 1 or 2: an edge of the mesh on a curve, or an element on a surface.
struct EntityElement {
  Shape shape = Shape::Line;
  std::vector<std::int32_t> nodes;  ///< Indices of mesh nodes in Gmsh's order.
  int sense = 0;                    ///< Elements of a surface with the same number are numbered in the same sense.
};

/// By curve of the geometry: each edge of the surface elements that lies on it, once.
std::vector<std::vector<EntityElement>> curve_elements(const HighOrderMesh& mesh, const Association& association);

/// By surface of the geometry: the elements that lie on it.
std::vector<std::vector<EntityElement>> surface_elements(const HighOrderMesh& mesh, const Association& association);

/// The basis of a shape at the points where the energy is evaluated: the points of a quadrature rule of degree 2 P, and
/// with small weights the nodes of the lattice of order P, whose vertices and edges a rule misses.
struct EntityTable {
  Eigen::MatrixXd values;                    ///< points × nodes.
  std::vector<Eigen::MatrixXd> derivatives;  ///< By direction: nodes × points.
  /// The same derivatives of the map of order 1 on the vertices: the straight-sided element.
  std::vector<Eigen::MatrixXd> straight;  ///< By direction: points × vertices.
  Eigen::VectorXd weights;                ///< Sum to 1 plus the small weights.
  /// Where the distance to the entity is measured: values of the basis, points × nodes. First come the points of a rule
  /// that integrates the square of an error of interpolation, then the lattice of 2 P + 1 intervals per edge.
  Eigen::MatrixXd between;
  Eigen::VectorXd weights_between;  ///< Of the points of the rule; they sum to 1.
  Eigen::MatrixXd finer;            ///< The same for the lattice of four times as many intervals.
  Eigen::MatrixXd finer_at;         ///< The points of that lattice on the reference shape: points × dimensions.
  double finer_step = 0;            ///< What points beside each other on it differ by at most, in a coordinate.
  /// By point of the former lattice: the points of the latter within one interval. First comes the point itself.
  std::vector<std::vector<Eigen::Index>> around;
  /// By point of the former lattice: the other points of it within one interval.
  std::vector<std::vector<Eigen::Index>> beside;
};
const EntityTable& entity_table(Shape shape, int order);

}  // namespace varimesh::detail
