// The options of an optimisation. The contract, the flags and the documentation use the same names.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh {

enum class Energy : std::uint8_t { Hyperelastic, LinearElastic, Winslow, Distortion };
enum class Strain : std::uint8_t {
  GreenLagrange,  ///< E = (FᵀF − 1)/2, invariant under rotation.
  Small,          ///< E = sym F − 1, the strain of the paper. The result depends on how the mesh is rotated.
};
enum class Volumetric : std::uint8_t {
  Log,    ///< κ/2 (ln J)²
  Trace,  ///< λ/2 (tr E)², the classical form. It has no barrier, so it cannot keep a mesh valid.
};
enum class Winslow : std::uint8_t {
  True,   ///< |cof F|²/J in 3-D. In 2-D both forms are the same.
  Paper,  ///< |F|²/J, the form of the paper, which in 3-D is not the Winslow functional.
};
enum class Constants : std::uint8_t {
  Reference,  ///< μ = 1/2.8, λ = κ = 1/0.6, the constants of the reference implementation (NekMesh), ν = 0.4.
  Standard,   ///< The same, except λ = 10 for the hyperelastic energy, with which the lowest scaled Jacobian ends
              ///< higher.
};
/// What the optimisation improves.
enum class Objective : std::uint8_t {
  Energy,    ///< The energy.
  Worst,     ///< The lowest scaled Jacobian. The mean ends at most 0.01 below the mean at the optimum of the energy.
  Accuracy,  ///< The least loss of accuracy (core/quality/accuracy/accuracy.h) that was found with a scaled Jacobian of
             ///< at least `min_js`. The energy only makes the mesh valid and looks for `min_js`.
  Auto,      ///< The default: Accuracy, or Energy if there is nothing to lower or another option asks for the energy's
             ///< optimum (objective_of()).
};
enum class Regularisation : std::uint8_t {
  Element,  ///< One δ per element, from its own smallest J.
  Patch,    ///< One δ per node, from the smallest J of the elements around it, as in the paper.
};
enum class Method : std::uint8_t {
  Auto,    ///< The default: sweeps until every cell is valid or no further cell becomes valid, then Newton's method,
           ///< then untangling of the cells that are still invalid.
  Sweeps,  ///< Newton's method node by node, in coloured parallel sweeps, as in the paper.
  Newton,  ///< All nodes at once: truncated Newton with matrix-free conjugate gradients.
};
enum class Colouring : std::uint8_t {
  Group,  ///< Colour clusters of cells. The nodes of a cluster are visited one after another while they are in cache.
  Node,   ///< Colour single nodes, as in section 3.4 of the paper.
};

enum class Until : std::uint8_t {
  Tolerance,  ///< Every free node is within `tolerance` of the optimum.
  Valid,      ///< Or sooner: every cell is certified valid or known to be unrepairable, or ten iterations certify no
              ///< further cell and no other method is left to try.
};

enum class Target : std::uint8_t {
  StraightSided,  ///< The cell that its vertices define. It keeps sizes, anisotropy and the heights of boundary layers.
  Ideal,          ///< The regular shape with the volume of the straight-sided cell. With the distortion energy this is
                  ///< the inverse mean ratio. Not for boundary layers, which become thicker.
  Size,           ///< The regular shape with edges of the length that target_field gives, or regular in its metric.
  Strain,         ///< The straight-sided cell stretched by target_field, as by heat in the thermo-elastic analogy of
                  ///< D. Moxey and others, CAD 72, 2016.
};
/// How the nodes of thin layers at a curved wall are spaced across the layers (core/layers/spacing.h).
enum class LayerSpacing : std::uint8_t {
  Keep,    ///< As the mesh came.
  Even,    ///< At equal distances in each cell.
  Graded,  ///< As the heights of the layers grow. Solutions that decay from the wall are then polynomials, nearly.
};
enum class Per : std::uint8_t {
  Cell,    ///< One value per cell, by element number.
  Vertex,  ///< One value per vertex, by node number; linear between vertices.
};

/// Where Newton's method has its vectors (docs/device.md).
enum class DeviceChoice : std::uint8_t {
  Cpu,   ///< On the processor.
  Gpu,   ///< On a graphics card. A run that cannot have one goes on on the processor, and says so.
  Auto,  ///< On a graphics card if there is one and the mesh is large enough (core/optimise/device/device_choice.h).
};

/// What is done about elements that no movement of free nodes can repair.
enum class Repair : std::uint8_t {
  None,        ///< Names them and treats them like any other element, at the cost of their neighbours.
  Report,      ///< Names them and keeps them from distorting other elements.
  Split,       ///< Splits interior edges and faces of tetrahedra if that makes room. Elements and nodes are added; the
               ///< boundary stays as it was. docs/repair.md describes the method and why it ends.
  Straighten,  ///< As Report. At the end, elements that are still invalid, and those that share a facet with one, are
               ///< made straight-sided as far as fixed nodes and the validity of other elements allow. Triangles and
               ///< tetrahedra only.
  Refine,      ///< As Split. If boundary nodes slide on a model and elements are left, edges on the boundary are split
               ///< too, with new nodes on the model (optimise_on_geometry.h).
  Topology,  ///< As Split. If elements are left, or have a scaled Jacobian below `min_js`, edges and faces between the
             ///< triangles or tetrahedra around them are swapped, and edges collapsed, where that helps. The boundary
             ///< and the groups stay (core/repair/swaps).
};

/// Whether elements may be split.
inline bool splits(Repair repair) {
  return repair == Repair::Split || repair == Repair::Refine || repair == Repair::Topology;
}

/// A size or strain for Target::Size and Target::Strain; read_target_field() reads it from text. Tensors are symmetric
/// and stored as their lower triangle, row by row: xx, xy, yy in 2-D, and also xz, yz, zz in 3-D.
struct TargetField {
  Per per = Per::Cell;
  /// Numbers per value. 1: a scalar, which is an edge length h in the mesh's own unit of length, or a strain ε (target
  /// = (1 + ε) × straight-sided). 3 in 2-D, 6 in 3-D: a tensor, which is a metric M in 1/length² or a strain E (target
  /// = (1 + E) × straight-sided). The metric asks for edges e with eᵀMe = 1; M = Σ n nᵀ/h² sets the heights h of a
  /// boundary layer in the directions n.
  int components = 1;
  /// Element or node numbers of the file. Empty: there is a value for each cell or node, in the mesh's order.
  std::vector<std::int64_t> numbers;
  std::vector<double> values;  ///< `components` per entry of `numbers`.
};

/// Settings of an optimisation; the defaults suit most meshes. option_table() has the range of each.
struct Options {
  Energy energy = Energy::Hyperelastic;
  Strain strain = Strain::GreenLagrange;      ///< Linear elastic only.
  Volumetric volumetric = Volumetric::Log;    ///< Linear elastic only.
  Winslow winslow = Winslow::True;            ///< Winslow in 3-D only.
  Constants constants = Constants::Standard;  ///< The set that mu, lambda and kappa come from if they are 0.
  double mu = 0;                              ///< Shear modulus, dimensionless; 0: from `constants`.
  double lambda = 0;                          ///< First Lamé constant, dimensionless; 0: from `constants`.
  double kappa = 0;                           ///< Bulk modulus, dimensionless; 0: from `constants`.
  Regularisation regularisation = Regularisation::Element;
  Method method = Method::Auto;
  Colouring colouring = Colouring::Group;
  bool active_set = true;          ///< Sweeps skip nodes around which nothing has moved by more than the tolerance.
  double tolerance = 1e-3;         ///< Stop when no free node is further than this from the optimum, as a fraction of
                                   ///< the size of the cells around it (core/problem/sizes.h, docs/method.md).
  int max_iterations = 1000;       ///< Stop after this many iterations; 0 only checks and reports.
  Until until = Until::Tolerance;  ///< What else to stop at.
  double until_js = 0;    ///< Above 0: stop when every cell's scaled Jacobian is proved to be at least this. The result
                          ///< is then, among the meshes with the fewest uncertified cells, the one with the highest
                          ///< proved minimum. Below 1.
  double time_limit = 0;  ///< Stop when this many seconds have passed; 0: never.
  int threads = 0;        ///< Threads to use; 0: all of the machine's.
  DeviceChoice device = DeviceChoice::Cpu;
  Objective objective = Objective::Auto;
  double min_js = 0.1;  ///< Objective::Accuracy only: the scaled Jacobian that every cell is to have at least, from 0
                        ///< to below 1. If no mesh of the run has it, the result has the least loss among those with at
                        ///< least half of the highest minimum that was found, and a note says so.
  LayerSpacing layer_spacing = LayerSpacing::Keep;  ///< Objective::Accuracy only.
  double p_norm = 1;  ///< The power, 1 to 16, to which the cells' mean energies are summed. A higher one weighs the
                      ///< worst cells more.
  int quadrature_degree = 0;  ///< Degree that is integrated exactly; 0: 2 P. At least 2 (P − 1) on simplices.

  Repair repair = Repair::Report;  ///< Split and Refine cannot be combined with target_field or region_below.

  int order = 0;  ///< Raise or lower the mesh to this order before it is optimised; 0: as it is.

  Target target = Target::StraightSided;  ///< The shape that each cell is compared with.
  TargetField target_field;               ///< For the targets Size and Strain. Size needs a value everywhere; Strain
                                          ///< is 0 if there is no value.

  bool orient = false;  ///< Cells that came clockwise are written counter-clockwise, not as they came.

  // By default, the nodes on faces with one neighbour and on every boundary or interface element of the file are fixed.
  // The next four options change that. A node that is fixed by name stays fixed even if another option frees it.
  std::vector<std::string> fix;          ///< Physical groups whose nodes stay, by name, by tag, or by "dimension:tag".
  std::vector<std::string> free;         ///< Groups of interface elements whose nodes may move; not the outer boundary.
  std::vector<std::int64_t> fix_nodes;   ///< Numbers of nodes that stay, with the whole edge or face of each.
  std::vector<std::int64_t> free_nodes;  ///< The same for nodes that may move; not on the outer boundary.
  double region_below = 0;               ///< Above 0: move nodes only near cells with a scaled Jacobian below this.
  int rings = 2;                         ///< The layers of cells around those cells that may move.
};

/// Checks ranges and combinations that do not depend on the mesh. Errors: BadOption, which names the option and its
/// range.
Expected<void> check(const Options& options);

/// The objective of a run on a mesh of this order: that of the options, or what Objective::Auto stands for. This is
/// Energy if an option of the energy (is_of_energy() in option_table.h) is not at its default, and for order 1, whose
/// elements have no curvature. Otherwise it is Accuracy.
Objective objective_of(const Options& options, int order);

}  // namespace varimesh
