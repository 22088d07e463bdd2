// How a surface in space is judged: each cell in the plane perpendicular to its mean normal. Internal to the library.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"
#include "core/quality/quality.h"
#include "core/validity/orientation.h"

namespace varimesh::detail {

/// A surface in space as a planar mesh, which everything that judges planar cells can take.
///
/// Let n be the unit vector along the mean normal ∫ x_ξ × x_η of a cell, e₁ and e₂ perpendicular to it and to each
/// other with e₁ × e₂ = n, and x₀ the cell's first node. The planar cell has the nodes (e₁, e₂, n) · (x − x₀). Its
/// Jacobian det ∂(e₁·x, e₂·x)/∂(ξ, η) is n · (x_ξ × x_η), a polynomial. It is positive everywhere if and only if no
/// normal of the cell is perpendicular to the mean normal or points to its other side. Its mean is positive, in
/// whichever sense the cell is numbered.
///
/// Cells do not share nodes, because each has a plane of its own. If the whole surface lies in one plane, they do: then
/// all are turned into this plane together, and an inverted cell is one that disagrees with its neighbours.
///
/// Planar coordinates are rounded to double, so what is proved holds up to 10⁻¹⁵ of the cell's size.
class FlatSurface {
 public:
  /// The surface must have passed check_judgeable(). Call it inside team.run(). The result does not depend on the
  /// number of threads.
  FlatSurface(const HighOrderMesh& surface, const Team& team);

  /// The planar cells, in the surface's order. The third coordinate is the height above the cell's first node. The
  /// number of an element is its place among the cells.
  const HighOrderMesh& mesh() const { return mesh_; }
  bool is_plane() const { return frames_.size() == 1; }

  /// Translates the report on mesh() into one on the surface: element numbers of the file, places in space.
  void put_in_space(QualityReport& report) const;

 private:
  /// Where a plane lies.
  struct Frame {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  ///< Rows: e₁, e₂, n.
  };
  void put_in_one_plane(const HighOrderMesh& surface, const Frame& frame, const Team& team);
  void put_in_own_planes(const HighOrderMesh& surface, const Team& team);

  HighOrderMesh mesh_;
  std::vector<std::int64_t> numbers_;  ///< Of the surface's elements, by cell.
  std::vector<Frame> frames_;          ///< One per cell, or one for all.
};

/// A mesh as it is judged: a surface in space is made planar, and then clockwise cells are turned. The mesh must
/// outlive it.
class JudgedMesh {
 public:
  /// Call it inside team.run(). `facets`: the facets of the mesh, if they are known and the mesh is no surface in
  /// space.
  explicit JudgedMesh(const HighOrderMesh& mesh, const Team& team = Team(1), const Facets* facets = nullptr);

  const HighOrderMesh& mesh() const { return oriented_->mesh(); }
  /// Null if the mesh is no surface in space.
  const FlatSurface* surface() const { return surface_ ? &*surface_ : nullptr; }
  /// The element numbers of the cells that came clockwise. On a surface in space, where neither sense is right, none.
  std::vector<std::int64_t> clockwise() const;

 private:
  std::optional<FlatSurface> surface_;
  std::optional<OrientedMesh> oriented_;
};

}  // namespace varimesh::detail
