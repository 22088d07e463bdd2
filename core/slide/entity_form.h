// The elements of one curve (d = 1) or surface (d = 2) of a geometry with the nodes that they have now. Internal to
// core/slide.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "core/association/association.h"
#include "core/base/team.h"
#include "core/slide/entity_energy.h"

namespace varimesh::detail {

/// A node of the elements of an entity.
struct EntityNode {
  std::int32_t node = 0;  ///< Index in the mesh.
  bool free = false;
  std::array<double, 2> at{};  ///< Its parameters on the entity.
  Eigen::Vector3d x = Eigen::Vector3d::Zero();
};

/// The nodes of the elements of a curve or surface, sorted by index. Nodes that belong to the entity itself and are not
/// fixed are free.
/// @param coordinates of all nodes of the mesh
std::vector<EntityNode> curve_nodes(int curve, const std::vector<EntityElement>& elements,
                                    const Association& association, const std::vector<double>& coordinates,
                                    const std::vector<bool>& fixed);
std::vector<EntityNode> surface_nodes(int surface, const Association& association,
                                      const std::vector<double>& coordinates, const std::vector<bool>& fixed);

/// The energy of the elements as a function of their nodes, which move along the entity.
template <int d>
class EntityForm {
 public:
  using Vectors = typename EntityEnergy<d>::Vectors;
  using Value = typename EntityEnergy<d>::Value;
  /// Elements that a thread takes at least at a time: about 0.1 ms of work.
  static constexpr std::int32_t kGrain = d == 1 ? 64 : 8;

  /// @param entity    the curve or surface
  /// @param elements  must outlive the object
  /// @param at_start  coordinates of all nodes of the mesh as they came, which set the targets
  EntityForm(const Association& association, int entity, const std::vector<EntityElement>& elements, int order,
             const std::vector<double>& at_start);

  /// Takes the nodes, and chooses the sign of each element's J: a curve's edges may run either way, and a surface's
  /// elements all have the sense that most of those with the same number of their sense have.
  void set_nodes(std::vector<EntityNode> nodes);

  /// EntityEnergy::leave_out_constant_points() for the nodes as they are free now.
  void leave_out_constant_points();

  std::vector<EntityNode>& nodes() { return nodes_; }
  const std::vector<EntityNode>& nodes() const { return nodes_; }
  std::vector<EntityNode> take_nodes() { return std::move(nodes_); }

  /// Sets the normals and the first derivatives where the nodes are. Until the next call the energy has these normals.
  /// At a pole the normal is the sum of the normals of the nodes around.
  void take_normals();
  bool is_at_pole(std::size_t node) const { return at_pole_[node]; }
  /// An orthonormal basis of the tangents at a node that is at no pole.
  Eigen::Matrix<double, 3, d> tangents(std::size_t node) const;
  /// The part of the Hessian in this basis that the entity's curvature brings, if `gradient` is the energy's at the
  /// node: the node leaves its tangents by half this form, times the gradient's part across them.
  Eigen::Matrix<double, d, d> curvature(std::size_t node, const Eigen::Vector3d& gradient) const;
  /// The node after it has moved along the entity, about by a tangent vector: by (SᵀS)⁻¹ Sᵀ times the vector in the
  /// parameters, with S the first derivatives.
  EntityNode moved(const EntityNode& node, std::size_t place, const Eigen::Vector3d& by) const;
  /// The parameters of the nearest point, near the parameters `guess`.
  std::array<double, 2> closest(const Eigen::Vector3d& x, const std::array<double, 2>& guess) const;
  /// The node at the nearest point to `x`, near where it is.
  EntityNode put(const EntityNode& node, const Eigen::Vector3d& x) const;
  /// The distance between nodes around a node: of the elements with it, the shortest straight edge over the order.
  double spacing(std::size_t node) const { return spacing_[node]; }

  std::size_t size() const { return local_.size(); }  ///< Elements.
  /// Places of an element's nodes in nodes().
  const std::vector<std::int32_t>& places(std::size_t element) const { return local_[element]; }
  Value value(std::size_t element, double delta) const;
  /// EntityEnergy::derivatives().
  void derivatives(std::size_t element, double delta, Eigen::VectorXd& gradient, Eigen::MatrixXd& hessian) const;
  /// The area or length of the straight-sided element as it came.
  double measure(std::size_t element) const { return energy_.measure(element); }
  /// The energy of all elements, and their smallest J, of all points and of those that are not constant. The sum has
  /// the order of the elements for any number of threads.
  Value total(double delta, const Team& team) const;
  /// Elements with J ≤ 0 at a point.
  std::int64_t folded(const Team& team) const;
  bool is_folded(std::size_t element) const { return value(element, 1).least <= 0; }

 private:
  std::vector<Value> values(double delta, const Team& team) const;
  void orient();
  double mean_sign(std::size_t element) const;
  Vectors positions(std::size_t element) const;
  Vectors normals(std::size_t element) const;

  const Association& association_;
  int entity_;
  const std::vector<EntityElement>& elements_;
  EntityEnergy<d> energy_;
  std::vector<EntityNode> nodes_;
  std::vector<std::vector<std::int32_t>> local_;  ///< By element: places of its nodes in nodes_.
  std::vector<double> spacing_, sign_;
  std::vector<bool> at_pole_;
  std::vector<Eigen::Matrix<double, 3, d>> S_;
  Vectors normals_;
};

extern template class EntityForm<1>;
extern template class EntityForm<2>;

}  // namespace varimesh::detail
