// Plane meshes in space: a 2-D mesh in any plane is put into a plane z = constant, and back.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/base/team.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Whether the mesh is 2-D and lies in a plane. Call it inside team.run().
bool lies_in_a_plane(const HighOrderMesh& mesh, const Team& team);
bool lies_in_a_plane(const HighOrderMesh& mesh);

/// The plane of a 2-D mesh that does not lie in a plane z = constant.
class Plane {
 public:
  /// Finds the plane; nothing if the mesh is 3-D, lies in a plane z = constant already, or bends: if a node is farther
  /// than lies_flat() allows from the plane. A plane that is perpendicular to an axis is taken as such, and coordinates
  /// in it are then two of those in space. The cells, as most of them are numbered, are counter-clockwise in it. Call
  /// it inside team.run().
  static std::optional<Plane> of(const HighOrderMesh& mesh, const Team& team);

  /// Gives each node its coordinates in the plane, and z = 0. Keeps the places in space for put_back().
  void flatten(HighOrderMesh& mesh);

  /// Puts a mesh that flatten() made, with nodes that have moved, into space. A node that has not moved is where it
  /// was, bit for bit. Others keep their distance from the plane, new ones lie in it.
  void put_back(HighOrderMesh& mesh) const;

  /// The place in space of a point in the plane.
  std::array<double, 3> in_space(double u, double v) const;

  const std::array<double, 3>& normal() const { return axes_[2]; }

 private:
  std::array<double, 2> in_plane(const double* x) const;

  std::array<double, 3> origin_{};
  std::array<std::array<double, 3>, 3> axes_{};  ///< Two directions in the plane, and its normal.
  std::vector<std::int64_t> numbers_;            ///< Of the nodes that flatten() had.
  std::vector<double> came_, flat_;              ///< Their coordinates in space and in the plane.
};

}  // namespace varimesh
