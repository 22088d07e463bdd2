// Nodes of a mesh that are images of each other, and whether they stay so. Internal to core/slide.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/association/association.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::detail {

/// The periodic links of a mesh. They refer to the mesh.
class PeriodicPairs {
 public:
  /// A link without a map gets the affine map that fits its nodes best.
  /// @param size  of the mesh
  PeriodicPairs(const HighOrderMesh& mesh, double size);

  bool any() const { return !links_.empty(); }
  /// Puts nodes that have slid almost to the images of their masters exactly there, with all parameters. The two sides
  /// of a period slide by themselves, and end where the same energy has its minimum, up to the accuracy of Newton's
  /// method.
  void put_on_images(HighOrderMesh& mesh, Association& association, const std::vector<bool>& fixed) const;
  /// Fixes the nodes of each link that holds no longer: a pair of it is off by more than 10⁻¹² of the size, and by more
  /// than any pair of the link when the mesh came. Returns whether there is such a link.
  bool fix_broken(const std::vector<double>& coordinates, std::vector<bool>& fixed) const;
  /// Fixes the nodes of all links.
  void fix_all(std::vector<bool>& fixed) const;

 private:
  using Affine = Eigen::Matrix<double, 3, 4>;
  struct Link {
    const PeriodicLink* of;
    Affine map;    ///< From the master's node to its image.
    double off{};  ///< The largest distance between a node and the image of its master's, as the mesh came.
  };
  static double off(const Link& link, const std::vector<double>& coordinates);
  static Eigen::Vector3d image(const Link& link, const std::vector<double>& coordinates, std::int32_t master);
  static void fix(const Link& link, std::vector<bool>& fixed);

  std::vector<Link> links_;
  double rounding_;
};

}  // namespace varimesh::detail
