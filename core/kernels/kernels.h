// What a sweep needs of an energy: the energy of a node's star and its derivatives, and moving the node. There are two
// implementations: a plain one in the notation of the paper, and a vectorised one for each instruction set.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "core/energy/material.h"
#include "core/problem/problem.h"

namespace varimesh {

/// One cell of a node's star, as pointers into its set. Arrays over points are `stride` long.
struct StarCell {
  double* deformation;           ///< F, row-major: d·d arrays.
  const double* derivatives;     ///< ∂φ/∂ξ_k of the node's basis function, d arrays.
  const double* inverse_target;  ///< A⁻¹, row-major: d·d numbers if affine, else d·d arrays.
  const double* left_factor;     ///< L, row-major: d·d numbers; null: L = 1.
  const double* measure;         ///< |det A| if affine, else the array of weight times |det A|.
  const double* weights;         ///< Quadrature weights.
  double delta_squared;          ///< 0: the cell is valid, and J must stay positive at every point.
  int stride;
  bool affine;
  /// CellSet::jacobian_function; null: it is evaluated each time.
  double* jacobian_function;
  /// Room for line_size() · stride numbers; null: none. expand() writes them for the energy_after() and move() that
  /// follow with the same F, and the last energy_after() writes some for a move() by the same step. Without room these
  /// functions compute everything again.
  double* line;
};

/// The energy of a star to second order in the displacement of its node: sums over the star of weight |det A| times W
/// and its derivatives. Entries of the third direction are 0 in 2-D.
struct StarExpansion {
  double energy = 0;
  double measure = 0;  ///< Σ weight |det A|.
  std::array<double, 3> gradient{};
  std::array<double, 6> hessian{};  ///< xx, xy, yy, xz, yz, zz: lower triangle by rows.
};

/// The energy and the validity of one cell, from its deformation gradients.
struct CellScan {
  double energy = 0;             ///< Σ weight |det A| W(F).
  double smallest_jacobian = 0;  ///< min det F over the points.
  double scaled_jacobian = 0;  ///< min/max of det ∇χ_M over the points, at least −1; −1 if it is nowhere positive.
};

/// The kernels of one energy in one dimension. All functions depend only on their arguments, so all threads can share
/// one object.
class Kernels {
 public:
  virtual ~Kernels() = default;

  /// Numbers per quadrature point of StarCell::line; 0: none are kept.
  virtual int line_size() const { return 0; }

  /// Whether keeping CellSet::jacobian_function saves time.
  virtual bool keeps_function() const { return false; }

  virtual StarExpansion expand(std::span<const StarCell> star) const = 0;

  /// The energy of the star with its node displaced by `step` (d numbers). +∞ if that makes J ≤ 0 in a valid cell, or
  /// if a number is not finite.
  virtual double energy_after(std::span<const StarCell> star, const double* step) const = 0;

  /// F += L step ⊗ A⁻ᵀ ∇φ in every cell of the star; updates the function of J too.
  virtual void move(std::span<const StarCell> star, const double* step) const = 0;

  /// The smallest J = det F in the star.
  virtual double smallest_jacobian(std::span<const StarCell> star) const = 0;

  /// Computes F of a cell from the positions of all nodes (d per node). `deformation`: row-major, d·d × set.stride.
  virtual void deform(const CellSet& set, std::int32_t cell, std::span<const double> positions,
                      double* deformation) const = 0;

  /// Computes the energy's function of J from the F of a cell, both as in CellSet. Only for energies that keep it.
  virtual void take_function(const double* /*deformation*/, int /*stride*/, double* /*function*/) const {}

  /// Scans a cell with this F and this function of J (null: it is evaluated).
  virtual CellScan scan(const CellSet& set, std::int32_t cell, const double* deformation,
                        const double* function) const = 0;

  /// deform() and take_function() into the arrays that the set holds, and scan() of these.
  void rebuild(CellSet& set, std::int32_t cell, std::span<const double> positions) const {
    deform(set, cell, positions, set.deformation_of(cell));
    if (double* function = set.jacobian_function_of(cell); function != nullptr)
      take_function(set.deformation_of(cell), set.stride, function);
  }
  CellScan scan_kept(const CellSet& set, std::int32_t cell) const {
    return scan(set, cell, set.deformation_of(cell), set.jacobian_function_of(cell));
  }
};

/// The vectorised kernels for the best instruction set that this machine has.
std::unique_ptr<Kernels> make_kernels(const Material& material, int dimension);

/// The plain kernels: one point after another, in the notation of the paper. Tests compare the vectorised ones with
/// them.
std::unique_ptr<Kernels> make_plain_kernels(const Material& material, int dimension);

}  // namespace varimesh
