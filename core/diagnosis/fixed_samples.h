// Points of cells and of their facets where J depends on fixed nodes only. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <vector>

#include "core/base/stop_token.h"
#include "core/mesh/connectivity.h"
#include "core/reference/basis.h"

namespace varimesh::detail {

/// A point where fixed nodes leave no room.
struct FixedSample {
  int dimension = 0;              ///< Of the smallest part of the cell it lies in: 0 vertex, 1 edge, 2 face, 3 inside.
  int vertex = -1;                ///< Local number of the vertex if the point is one.
  std::array<double, 3> place{};  ///< Physical coordinates.
  double jacobian = 0;     ///< J there over the largest |J| sampled in the cell; for a facet, the same for its normal.
  bool is_curved = false;  ///< Of a folded facet: it is not flat, and `jacobian` is its room (face_room()).
};

/// The point condition: J must be positive at the points of a cell where it depends on fixed nodes only.
class FixedSamples {
 public:
  FixedSamples(const HighOrderMesh& mesh, const Cells& cells);

  /// The worst point of each dimension at which J ≤ 0 whatever the free nodes do. In 3-D the vertices are left out; the
  /// vertex condition covers them. `fixed`: by node; `sign`: −1 if the mesh is numbered clockwise. Throws Interrupted
  /// if `stop` says so.
  std::vector<FixedSample> worst(std::size_t cell, const std::vector<bool>& fixed, double sign,
                                 const StopToken* stop = nullptr) const;

 private:
  /// The basis at a range of a lattice's points.
  struct Rows {
    Eigen::Index first = 0, count = 0;       // the points `first` to `first` + `count` − 1
    std::vector<Eigen::MatrixXd> gradients;  // a count × nodes matrix per direction
    std::vector<std::vector<int>> enter;     // by point: the nodes that J depends on there
  };
  /// The lattice of one shape and order. The rows of hexahedra of order 10 would take 450 MB. So they are made for a
  /// range of points at a time, and kept only if all of them are small.
  struct Table {
    explicit Table(reference::BasisAtPoints on_lattice) : basis(std::move(on_lattice)) {}
    Rows make_rows(Eigen::Index first, Eigen::Index count) const;
    /// Sets `kept` and `values`.
    void keep_all(const StopToken* stop);

    reference::BasisAtPoints basis;
    Eigen::Index per_range = 0;            // points of a range, except the last one
    Rows kept;                             // all rows, if there is only one range
    Eigen::MatrixXd values;                // points × nodes; empty if the rows are not kept
    std::vector<int> dimension;            // by point
    std::vector<int> vertex;               // by point; −1 if it is none
    std::vector<std::vector<int>> facets;  // by facet: its nodes
  };
  static Table make_table(Shape shape, int order, int dimension, const StopToken* stop);
  /// Made once and kept until the program ends.
  static const Table& table(Shape shape, int order, int dimension, const StopToken* stop);

  /// J at every point, and whether all nodes are held that it depends on there.
  struct Sampled {
    std::vector<double> jacobian;
    std::vector<char> is_held;
  };
  /// `x`: the positions of the cell's nodes; `held`: by node of the cell.
  static Sampled sample(const Table& table, const Eigen::MatrixXd& x, const std::vector<bool>& held, double sign,
                        const StopToken* stop);

  const HighOrderMesh& mesh_;
  const Cells& cells_;
};

/// The Bernstein polynomials of this degree on the triangle: a row for each point, a column for each polynomial.
/// `points`: as reference::Points of the reference triangle, two coordinates each.
Eigen::MatrixXd bernstein_on_triangle(int degree, const Eigen::MatrixXd& points);

/// On a face with unit normals n, the Jacobian of an element of order P is n · v times a positive number, where v is
/// the derivative of the element's map into the element, a polynomial of degree P − 1 on the face. The room is the
/// largest value that the smallest n · v can have among the fields whose coefficients have a mean square of one. It is
/// 1 for a flat face. If it is 0, the element is invalid wherever the free nodes go; if it is small, v must turn so
/// sharply that the element has hardly any room.
///
/// By duality, the room is the distance from 0 to the convex hull of the vectors √K n ⊗ B, with the K polynomials B at
/// each point. It is computed as in B. F. Mitchell, V. F. Demyanov, V. N. Malozemov, Finding the point of a polyhedron
/// closest to the origin, SIAM J. Control 12, 1974.
///
/// @param fields  by point and polynomial: values of a basis of degree P − 1, for example bernstein_on_triangle()
/// @param normals by point: the unit normal, three columns
/// @param enough  the search ends once the room is known to be larger; then the result is a lower bound
double face_room(const Eigen::MatrixXd& fields, const Eigen::MatrixXd& normals, double enough);

/// Flat fixed facets whose normal changes sign (in 2-D, straight edges whose tangent does), and curved fixed triangles
/// whose normals turn by more than 90° and leave hardly any room. The jacobian of a sample is the smallest component of
/// a normal along the longest over the longest, at most 0; for a curved triangle it is the room, at least 0.
class FoldedFacets {
 public:
  FoldedFacets(const HighOrderMesh& mesh, const Cells& cells);

  /// One sample for each folded facet of the cell.
  std::vector<FixedSample> in(std::size_t cell, const std::vector<bool>& fixed) const;

 private:
  struct Table {
    Eigen::MatrixXd values;
    std::vector<Eigen::MatrixXd> gradients;
    Eigen::MatrixXd fields;  ///< Of a triangle: as face_room() takes them; else empty.
  };
  bool folded(const Table& table, const Eigen::MatrixXd& coordinates, FixedSample& sample) const;

  const HighOrderMesh& mesh_;
  const Cells& cells_;
  std::map<Shape, Table> tables_;
};

}  // namespace varimesh::detail
