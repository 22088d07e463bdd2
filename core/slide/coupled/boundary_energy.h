// The energy of the elements on all curves and surfaces, and their nodes, which move along them together with the
// mesh. Internal to core/slide.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/slide/between_nodes.h"
#include "core/slide/coupled/boundary_hessian.h"
#include "core/slide/entity_form.h"

namespace varimesh::detail {

/// The elements of all entities: E = Σ_e w_e E_e/|e|, with E_e of entity_energy.h. On a surface w_e is the volume of
/// the cells at the element, on a curve a twelfth of the volumes of the cells around it, both times a weight. So the
/// terms are as large as those of the volume, whatever the size of the elements.
class BoundaryEnergy {
 public:
  using Matrix = BoundaryHessian::Matrix;

  /// The elements by curve and by surface, and where the nodes are.
  struct Start {
    const Association& association;
    const std::vector<std::vector<EntityElement>>& curves;
    const std::vector<std::vector<EntityElement>>& surfaces;
    int order;
    const std::vector<double>& targets;      ///< Coordinates of all nodes of the mesh, which set the targets.
    const std::vector<double>& coordinates;  ///< Where the nodes are.
    const std::vector<bool>& fixed;          ///< By node: whether the caller fixes it.
  };
  BoundaryEnergy(const Start& start, const Team& team);

  /// Whether a node slides: it is free and at no pole.
  bool slides(std::int32_t node) const { return owner_[static_cast<std::size_t>(node)].dimension > 0; }

  /// Sets the weights of the elements and the numbers of the nodes.
  /// @param volumes   by cell of the mesh, in cubes of `diagonal`
  /// @param nodes     the nodes that may move, by rank
  /// @param diagonal  the unit of length of gradients and Hessians, in the mesh's unit
  void prepare(const HighOrderMesh& mesh, std::span<const double> volumes, std::span<const std::int32_t> nodes,
               double diagonal);

  struct Value {
    double energy = 0;  ///< Infinite if J ≤ 0 at a point and δ = 0.
    double least = 0;   ///< The smallest J of all elements.
  };
  /// With the weights times `factor`.
  Value value(double delta, double factor) const;

  /// By rank: the directions in which the node may move, as columns of length 1; those left are zero.
  std::vector<Eigen::Matrix3d> directions() const;
  /// Adds the energy's gradient to `gradient` (3 per rank), and returns the positive part of its Hessian (3 rows per
  /// rank), which has only nodes that slide, in their directions. It has the curvature of the entities as well. For
  /// this, `gradient` must be the gradient of all other energies on entry. The matrix stays until the next call.
  const Matrix& linearise(double delta, double factor, bool positive, const std::vector<Eigen::Matrix3d>& directions,
                          std::vector<double>& gradient);

  /// Where the nodes of all entities are.
  struct Places {
    std::vector<std::vector<EntityNode>> curves, surfaces;
  };
  Places places() const;
  /// Puts the nodes back to where they were.
  void restore(const Places& places);
  /// Moves the nodes that slide along their entities, from `start`, about by `step` (3 per rank, in the mesh's unit),
  /// but none by more than half the distance between nodes. A node that would leave its surface stays. Sets the
  /// coordinates of these nodes. The normals stay as they are until follow().
  void move(const Places& start, std::span<const double> step, std::vector<double>& coordinates);
  /// Puts the nodes that slide a part of the way from `start` to `end`. A node that would leave its surface stays.
  /// @param parts  by node of the mesh
  void move_between(const Places& start, const Places& end, std::span<const double> parts,
                    std::vector<double>& coordinates);
  /// Takes the normals and parameters at the places to which nodes were moved.
  void follow();

  /// Between the nodes.
  struct Distance {
    Distances surfaces, curves;
  };
  Distance distance(const std::vector<double>& coordinates) const;
  std::int64_t folded() const;  ///< Elements on surfaces.

  /// One element of a curve or surface now.
  struct Element {
    std::span<const std::int32_t> nodes;  ///< Of the mesh.
    bool is_on_surface = false;
    bool is_folded = false;
    Distances distances;
  };
  /// Those of all curves, then those of all surfaces, always in the same order.
  std::vector<Element> elements(const std::vector<double>& coordinates) const;
  /// Writes parameters and places to the association.
  void write(Association& association) const;

 private:
  struct Owner {
    std::int8_t dimension = 0;  ///< Of the entity along which the node moves; 0: it stays.
    std::int32_t entity = 0, place = 0;
  };
  template <int d>
  using Forms = std::vector<std::optional<EntityForm<d>>>;
  /// By entity: where the blocks of for_pairs() begin, one element after the other.
  using BlockPlaces = std::vector<std::vector<BoundaryHessian::Place>>;

  template <int d>
  void own(const Forms<d>& forms);
  /// Sets the places of all entries of the Hessian.
  void prepare_hessian();
  /// Calls visit(a, b, row, column) for all pairs of an element's nodes that move, with their ranks.
  template <int d, class Visit>
  void for_pairs(const EntityForm<d>& form, std::size_t element, const Visit& visit) const;
  template <int d>
  void add(const Forms<d>& forms, const std::vector<std::vector<double>>& weights, const BlockPlaces& blocks,
           double delta, double factor, const std::vector<Eigen::Matrix3d>& directions, std::vector<double>& gradient);
  template <int d>
  Value sum(const Forms<d>& forms, const std::vector<std::vector<double>>& weights, double delta) const;
  void add_curvature(const std::vector<Eigen::Matrix3d>& directions, const std::vector<double>& gradient);
  /// Calls to(owner, from) for all nodes that slide, and puts them there.
  template <class To>
  void move_each(const Places& start, const To& to, std::vector<double>& coordinates);
  EntityNode moved(const Owner& owner, const EntityNode& from, const Eigen::Vector3d& by) const;
  /// `to`, unless the node would leave its surface: then `from`.
  EntityNode unless_it_leaves(const Owner& owner, const EntityNode& from, const EntityNode& to) const;

  const Association& association_;
  int order_;
  const std::vector<std::vector<EntityElement>>& curve_elements_;
  const std::vector<std::vector<EntityElement>>& surface_elements_;
  const Team& team_;
  Forms<1> curves_;                                                   ///< By curve; nothing if no element lies on it.
  Forms<2> surfaces_;                                                 ///< By surface.
  std::vector<Owner> owner_;                                          ///< By node of the mesh.
  std::vector<std::int32_t> rank_;                                    ///< By node of the mesh; −1: it does not move.
  std::vector<std::int32_t> sliding_;                                 ///< The nodes that slide, by index.
  std::vector<std::vector<double>> curve_weights_, surface_weights_;  ///< w_e/|e|, by entity and element.
  double diagonal_ = 1;
  BoundaryHessian hessian_;
  BlockPlaces curve_blocks_, surface_blocks_;
  std::vector<BoundaryHessian::Place> own_blocks_;  ///< By node of sliding_ that moves: where its own block begins.
};

}  // namespace varimesh::detail
