// The parameters of nodes that the file of a mesh has: what association takes from them, and how they are kept.
// Internal to the library.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "core/association/association.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Replaces the parameters in each block of nodes that came with parameters by the parameters of `association`, so that
/// a block never mixes two parametrisations. A node keeps the parameters of the file if they lead to it and the node
/// did not move. A block loses its parameters if its nodes do not all belong to the same entity.
void keep_parameters(HighOrderMesh& mesh, const Association& association);

namespace detail {

/// Closer than this to a node, relative to the size, parameters of a file lead to it.
inline constexpr double kParameterTolerance = 1e-6;

/// What a file says about a node.
struct FilePlace {
  int dimension = -1;  ///< Of the entity on which the node is classified; −1: the file does not say.
  int tag = 0;         ///< Of the entity.
  bool has_parameters = false;
  std::array<double, 2> at{};
};

/// The places of all nodes of a mesh. They refer to the mesh.
class FilePlaces {
 public:
  explicit FilePlaces(const HighOrderMesh& mesh);
  FilePlace of(std::int32_t node) const;
  bool any() const { return any_; }

 private:
  std::span<const NodeBlock> blocks_;
  bool any_ = false;  ///< Whether a block has parameters.
};

/// The foot of a node to which its parameters lead. If they lead elsewhere, its distance is infinite. Parameters that
/// lead to the node up to rounding stay as they are.
geometry::CurveFoot foot_at(const geometry::CurveShape& curve, const Eigen::Vector3d& x, double t, double size);
geometry::SurfaceFoot foot_at(const geometry::SurfaceShape& surface, const Eigen::Vector3d& x,
                              const std::array<double, 2>& at, double size);

}  // namespace detail
}  // namespace varimesh
