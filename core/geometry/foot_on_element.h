// The closest point of one surface element, inside its reference triangle or square. Internal to the library.
#pragma once

#include "core/geometry/element_map.h"

namespace varimesh::geometry {

struct ElementFoot {
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  ///< (ξ, η), inside the reference element or on its border.
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
  double distance = 0;
  bool on_border = false;
};

/// Whether the reference coordinates lie in the element or on its border, up to rounding.
bool is_in_element(Shape shape, const Eigen::Vector2d& at);

/// The foot to which Newton's method comes from `from`: a local minimum of the distance in the element. It is never
/// farther than the nearest point of the reference element to `from`. A step that is shorter than the rounding of the
/// coordinates, or than `share` times the distance, is not taken any more. The distance then lacks about half of
/// share² of itself.
ElementFoot foot_on_element(const ElementMap& map, const Eigen::Vector3d& point, const Eigen::Vector2d& from,
                            double share = 0);

/// The reference coordinates of the element's node that is nearest to `point`.
Eigen::Vector2d nearest_node(const ElementMap& map, const Eigen::Vector3d& point);

/// The nearest of the feet that Newton's method finds from the few nodes that are nearest to `point`. If the element is
/// folded over, the nearest node alone may lie on the wrong side of the fold.
ElementFoot nearest_foot(const ElementMap& map, const Eigen::Vector3d& point);

}  // namespace varimesh::geometry
