// What a sweep asks of an energy: the energy of a node's star, its derivatives, and a step taken. Two implementations:
// a plain one that reads like the paper, and a vectorised one for each instruction set.
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
  double* deformation;           ///< F, d·d arrays.
  const double* derivatives;     ///< ∂φ/∂ξ_k of the node at hand, d arrays.
  const double* inverse_target;  ///< d·d numbers where affine, else d·d arrays.
  const double* left_factor;     ///< L, d·d numbers; null: 1.
  const double* measure;         ///< |det A| where affine, else the array of weight times |det A|.
  const double* weights;         ///< Quadrature weights.
  double delta_squared;          ///< 0: the cell is valid, and J must stay positive at every point.
  int stride;
  bool affine;
  /// CellSet::jacobian_function; null: it is taken anew each time.
  double* jacobian_function;
  /// Room for line_size() · stride numbers, which expand() leaves for the energy_after() and move() that follow it with
  /// F as it was, and the last energy_after() for a move() by the same step; null: none, and they do without.
  double* line;
};

/// The star's energy as a function of the node's displacement, to second order, about where it is.
/// Unused directions in 2-D are 0. Σ over the star of weight |det A| times W and its derivatives.
struct StarExpansion {
  double energy = 0;
  double measure = 0;  ///< Σ weight |det A|.
  std::array<double, 3> gradient{};
  std::array<double, 6> hessian{};  ///< xx, xy, yy, xz, yz, zz: lower triangle by rows.
};

/// What a cell's deformation gradients say.
struct CellScan {
  double energy = 0;             ///< Σ weight |det A| W(F).
  double smallest_jacobian = 0;  ///< min det F over the points.
  double scaled_jacobian = 0;    ///< min/max of det ∇χ_M over the points; −1 where it is nowhere positive.
};

/// The kernels of one energy in one dimension. Everything is a pure function of its arguments, so one object serves
/// every thread.
class Kernels {
 public:
  virtual ~Kernels() = default;

  /// Numbers a quadrature point of StarCell::line; 0: none are kept.
  virtual int line_size() const { return 0; }

  /// Whether it pays to keep CellSet::jacobian_function.
  virtual bool keeps_function() const { return false; }

  virtual StarExpansion expand(std::span<const StarCell> star) const = 0;

  /// The star's energy with the node displaced by `step`; +∞ where that makes a valid cell's J ≤ 0 or a number not
  /// finite.
  virtual double energy_after(std::span<const StarCell> star, const double* step) const = 0;

  /// F += L step ⊗ A⁻ᵀ ∇φ in every cell of the star, and its function of J with it.
  virtual void move(std::span<const StarCell> star, const double* step) const = 0;

  /// The smallest J = det F in the star.
  virtual double smallest_jacobian(std::span<const StarCell> star) const = 0;

  /// F of a cell from its nodes' positions (d a node), into `deformation`: d·d × set.stride, row-major.
  virtual void deform(const CellSet& set, std::int32_t cell, std::span<const double> positions,
                      double* deformation) const = 0;

  /// The energy's function of J from F of a cell, both as CellSet has them; for those that keep it.
  virtual void take_function(const double* /*deformation*/, int /*stride*/, double* /*function*/) const {}

  /// Of a cell with this F and this function of J (null: it is taken anew).
  virtual CellScan scan(const CellSet& set, std::int32_t cell, const double* deformation,
                        const double* function) const = 0;

  /// The same with the F that the set keeps.
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

/// The plain kernels: a point after the other, in the notation of the paper. What the vectorised ones are tested with.
std::unique_ptr<Kernels> make_plain_kernels(const Material& material, int dimension);

/// δ² of the regularised Jacobian for a cell, or star, whose smallest J is `smallest`: 0 where that is positive, else
/// (0.4 J)² + 4e-8, as the reference implementation has it, so that δ goes to zero as the mesh becomes valid.
inline double delta_squared_for(double smallest) { return smallest > 0 ? 0.0 : 4e-8 + 0.16 * smallest * smallest; }

/// δ² of a cell that cannot be repaired. J is about 1 in a good cell, so with δ = 1 the energy's slope is mild whatever
/// J is: the cell keeps a shape, and presses on nobody.
inline constexpr double kUnrepairableDeltaSquared = 1;

}  // namespace varimesh
