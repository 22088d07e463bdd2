// What a user can choose about an optimisation. The same names stand in the proto, the flags and the documentation.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh {

enum class Energy : std::uint8_t { Hyperelastic, LinearElastic, Winslow, Distortion };
enum class Strain : std::uint8_t {
  GreenLagrange,  ///< E = (FᵀF − 1)/2, invariant under rotation.
  Small,          ///< E = sym F − 1, the paper's; its result depends on how the mesh is rotated.
};
enum class Volumetric : std::uint8_t {
  Log,    ///< κ/2 (ln J)²
  Trace,  ///< λ/2 (tr E)², the classical form: no barrier, so it cannot keep a mesh valid.
};
enum class Winslow : std::uint8_t {
  True,   ///< |cof F|²/J in 3-D (in 2-D the same as the paper's).
  Paper,  ///< |F|²/J, which in 3-D is not the Winslow functional.
};
enum class Constants : std::uint8_t {
  Reference,  ///< μ = 1/2.8, λ = κ = 1/0.6: those of the reference implementation (NekMesh), ν = 0.4.
  Standard,   ///< The same, but for the hyperelastic energy λ = 10: the lowest scaled Jacobian ends higher.
};
/// What the mesh is to be best at.
enum class Objective : std::uint8_t {
  Energy,  ///< The energy.
  Worst,   ///< The lowest scaled Jacobian; the mean ends at most 0.01 under that of the energy's optimum.
};
enum class Regularisation : std::uint8_t {
  Element,  ///< One δ an element, from its own smallest J.
  Patch,    ///< One δ a node's patch, from the patch's smallest J, as in the paper.
};
enum class Method : std::uint8_t {
  Auto,    ///< Sweeps until every cell is valid (or no more become so), then Newton, and untangling of what these
           ///< leave: the default.
  Sweeps,  ///< Node-wise Newton in coloured parallel sweeps, as in the paper.
  Newton,  ///< All nodes at once: truncated Newton with matrix-free conjugate gradients.
};
enum class Colouring : std::uint8_t {
  Group,  ///< Colour clusters of cells, whose nodes are visited one after another while they are in cache.
  Node,   ///< Colour single nodes, as in the paper's section 3.4.
};

enum class Until : std::uint8_t {
  Tolerance,  ///< The residual is at most `tolerance`.
  Valid,      ///< Or sooner: every cell is certified valid, or named unrepairable, or ten iterations bring no more
              ///< and no other method is to come.
};

enum class Target : std::uint8_t {
  StraightSided,  ///< Each cell on its vertices alone: keeps sizes, anisotropy and the heights of boundary layers.
  Ideal,          ///< The regular shape with the straight-sided cell's volume. With the distortion energy this is the
                  ///< inverse mean ratio. Boundary layers swell: not for them.
  Size,           ///< The regular shape with edges of the length that target_field gives, or regular in its metric.
  Strain,         ///< The straight-sided cell stretched by target_field, as by heat in the thermo-elastic analogy of
                  ///< D. Moxey and others, CAD 72, 2016.
};
enum class Per : std::uint8_t {
  Cell,    ///< One value a cell, by element number.
  Vertex,  ///< One value a vertex, by node number, linear in between.
};

/// What is done about elements that no movement of free nodes can repair.
enum class Repair : std::uint8_t {
  None,        ///< They are named, and treated like any other: their neighbours pay for them.
  Report,      ///< They are named and kept out of the others' way.
  Split,       ///< Interior edges and faces of tetrahedra are split where that makes room: new elements, new nodes, and
               ///< the boundary as it was. docs/repair.md says how, and why it ends.
  Straighten,  ///< As Report; what is left invalid, and what shares a facet with it, is made straight-sided at the end,
               ///< as far as fixed nodes and the validity of others allow. Triangles and tetrahedra only.
};

/// A size or strain for Target::Size and Target::Strain; read_target_field() reads it from text. Tensors are
/// symmetric, their lower triangle by rows: xx, xy, yy in 2-D, then xz, yz, zz.
struct TargetField {
  Per per = Per::Cell;
  /// 1: a number: an edge length h in the mesh's own unit of length, or a strain ε (target = (1 + ε) × straight-sided).
  /// 3 in 2-D, 6 in 3-D: a tensor: a metric M whose unit is 1/length² (an edge e is wanted with eᵀMe = 1, so that
  /// heights of a boundary layer are wanted by M = Σ n nᵀ/h²), or a strain E (target = (1 + E) × straight-sided).
  int components = 1;
  /// Element or node numbers as the file has them. Empty: there is a value for each cell, or node, in the mesh's order.
  std::vector<std::int64_t> numbers;
  std::vector<double> values;  ///< `components` a number.
};

/// Settings of an optimisation; the defaults suit most meshes.
struct Options {
  Energy energy = Energy::Hyperelastic;
  Strain strain = Strain::GreenLagrange;      ///< Linear elastic only.
  Volumetric volumetric = Volumetric::Log;    ///< Linear elastic only.
  Winslow winslow = Winslow::True;            ///< Winslow in 3-D only.
  Constants constants = Constants::Standard;  ///< The set that mu, lambda and kappa come from where they are 0.
  double mu = 0;                              ///< Shear modulus, dimensionless; 0: from `constants`.
  double lambda = 0;                          ///< First Lamé constant, dimensionless; 0: from `constants`.
  double kappa = 0;                           ///< Bulk modulus, dimensionless; 0: from `constants`.
  Regularisation regularisation = Regularisation::Element;
  Method method = Method::Auto;
  Colouring colouring = Colouring::Group;
  bool active_set = true;          ///< Sweeps pass over nodes round which nothing has moved by more than the tolerance.
  double tolerance = 1e-6;         ///< Stop when the residual, relative to the bounding box's diagonal, is below this.
  int max_iterations = 1000;       ///< Stop after this many iterations; 0 checks and reports only.
  Until until = Until::Tolerance;  ///< What else to stop at.
  double until_js = 0;    ///< Where above 0: stop when every cell's scaled Jacobian is proved to be at least this; the
                          ///< mesh returned is then, of those with the fewest uncertified cells, the one with the
                          ///< highest proved minimum. Below 1.
  double time_limit = 0;  ///< Stop at the end of the iteration in which so many seconds have passed; 0: never.
  int threads = 0;        ///< Threads to use; 0: all of the machine's.
  Objective objective = Objective::Energy;
  double p_norm = 1;  ///< The cells' mean energies are summed to this power, 1 to 16; more presses on the worst.
  int quadrature_degree = 0;  ///< Degree integrated exactly; 0: 2 P. Not under 2 (P − 1) on simplices.

  Repair repair = Repair::Report;  ///< Split goes with neither target_field nor region_below.

  int order = 0;  ///< Raise or lower the mesh to this order on the way in; 0: as it is.

  Target target = Target::StraightSided;  ///< What each cell would like to be.
  TargetField target_field;               ///< For the targets Size and Strain. Size wants a value everywhere; where
                                          ///< Strain has none it is 0.

  // Fixed are the nodes on faces with one neighbour and on every boundary or interface element of the file. These
  // change that; what is fixed by name stays fixed whatever else is said.
  std::vector<std::string> fix;          ///< Physical groups whose nodes stay, by name, by tag, or by "dimension:tag".
  std::vector<std::string> free;         ///< Groups of interface elements whose nodes may move; not the outer boundary.
  std::vector<std::int64_t> fix_nodes;   ///< Node numbers that stay (with the whole edge or face that they lie in).
  std::vector<std::int64_t> free_nodes;  ///< Node numbers that may move (likewise); not on the outer boundary.
  double region_below = 0;  ///< Where above 0: only near cells with a scaled Jacobian below this, nodes may move.
  int rings = 2;            ///< How many layers of cells around those are near.
};

/// Checks ranges and combinations that do not depend on the mesh. Errors: BadOption, naming the option and its range.
Expected<void> check(const Options& options);

}  // namespace varimesh
