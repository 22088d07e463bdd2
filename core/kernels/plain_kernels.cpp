// The plain kernels: one point after another, with W and its derivatives from core/energy/density.h. They keep nothing
// but F. They are the readable reference that the vectorised kernels are compared with, and need not be fast.
#include <Eigen/Dense>
#include <cmath>
#include <limits>

#include "core/energy/density.h"
#include "core/kernels/kernels.h"

namespace varimesh {
namespace {

template <int d>
class PlainKernels final : public Kernels {
  using MatrixD = Eigen::Matrix<double, d, d>;
  using VectorD = Eigen::Matrix<double, d, 1>;

 public:
  explicit PlainKernels(const Material& material) : material_(material), barrier_(has_barrier(material)) {}

  /// Moving a node by a changes F to F + L a ⊗ g, with g = A⁻ᵀ ∇_ξ φ. So the gradient of the star's energy is Σ w L P g
  /// and its Hessian is Σ w L (g · d²W/dF² · g) L.
  StarExpansion expand(std::span<const StarCell> star) const override {
    StarExpansion sum;
    for (const StarCell& cell : star) {
      const MatrixD L = left_factor(cell.left_factor);
      for (int q = 0; q < cell.stride; ++q) {
        const double w = weight(cell, q);
        const VectorD g = gradient(cell, q);
        const Density<d> at = density<d>(material_, deformation(cell.deformation, cell.stride, q), cell.delta_squared);
        sum.measure += w;
        sum.energy += w * at.W;
        VectorD gradient;
        MatrixD hessian;
        for (int i = 0; i < d; ++i) {
          gradient[i] = at.P.template segment<d>(i * d).dot(g);
          for (int j = 0; j < d; ++j) hessian(i, j) = g.dot(at.H.template block<d, d>(i * d, j * d) * g);
        }
        gradient = L * gradient;
        hessian = L * hessian * L;
        for (int i = 0, entry = 0; i < d; ++i) {
          sum.gradient[i] += w * gradient[i];
          for (int j = 0; j <= i; ++j, ++entry) sum.hessian[entry] += w * hessian(i, j);
        }
      }
    }
    return sum;
  }

  double energy_after(std::span<const StarCell> star, const double* step) const override {
    double energy = 0;
    for (const StarCell& cell : star) {
      const VectorD a = left_factor(cell.left_factor) * Eigen::Map<const VectorD>(step);
      for (int q = 0; q < cell.stride; ++q) {
        const MatrixD F = deformation(cell.deformation, cell.stride, q) + a * gradient(cell, q).transpose();
        if (barrier_ && cell.delta_squared == 0 && !(F.determinant() > 0))
          return std::numeric_limits<double>::infinity();
        energy += weight(cell, q) * energy_density<d>(material_, F, cell.delta_squared);
      }
    }
    return std::isfinite(energy) ? energy : std::numeric_limits<double>::infinity();
  }

  void move(std::span<const StarCell> star, const double* step) const override {
    for (const StarCell& cell : star) {
      const VectorD a = left_factor(cell.left_factor) * Eigen::Map<const VectorD>(step);
      for (int q = 0; q < cell.stride; ++q) {
        const VectorD g = gradient(cell, q);
        for (int i = 0; i < d; ++i)
          for (int j = 0; j < d; ++j) cell.deformation[(i * d + j) * cell.stride + q] += a[i] * g[j];
      }
    }
  }

  double smallest_jacobian(std::span<const StarCell> star) const override {
    double smallest = std::numeric_limits<double>::infinity();
    for (const StarCell& cell : star)
      for (int q = 0; q < cell.stride; ++q)
        smallest = std::min(smallest, deformation(cell.deformation, cell.stride, q).determinant());
    return smallest;
  }

  void deform(const CellSet& set, std::int32_t cell, std::span<const double> positions, double* F) const override {
    const std::int32_t* nodes = set.nodes.data() + static_cast<std::size_t>(cell) * set.nodes_per_cell;
    for (int q = 0; q < set.stride; ++q) {
      MatrixD G = MatrixD::Zero();  // ∇_ξ χ_M
      for (int n = 0; n < set.nodes_per_cell; ++n)
        for (int i = 0; i < d; ++i)
          for (int k = 0; k < d; ++k)
            G(i, k) +=
                positions[static_cast<std::size_t>(nodes[n]) * d + i] * set.derivatives_of(n)[k * set.stride + q];
      const MatrixD at = left_factor(set.left_factor_of(cell)) * G *
                         inverse_target(set.inverse_target_of(cell), set.affine, set.stride, q);
      for (int i = 0; i < d; ++i)
        for (int j = 0; j < d; ++j) F[(i * d + j) * set.stride + q] = at(i, j);
    }
  }

  CellScan scan(const CellSet& set, std::int32_t cell, const double* cell_deformation, const double*) const override {
    CellScan out;
    double smallest = std::numeric_limits<double>::infinity(), largest = -smallest;
    out.smallest_jacobian = smallest;
    for (int q = 0; q < set.points; ++q) {
      const MatrixD F = deformation(cell_deformation, set.stride, q);
      const double volume = set.affine ? set.measure_of(cell)[0] : set.measure_of(cell)[q] / set.weights[q];
      const double J = F.determinant();
      out.smallest_jacobian = std::min(out.smallest_jacobian, J);
      smallest = std::min(smallest, J * volume);
      largest = std::max(largest, J * volume);
      out.energy += set.weights[q] * volume * energy_density<d>(material_, F, set.delta_squared[cell]);
    }
    out.scaled_jacobian = largest > 0 ? std::max(smallest / largest, -1.0) : -1.0;
    return out;
  }

 private:
  static double weight(const StarCell& cell, int q) {
    return cell.affine ? cell.weights[q] * cell.measure[0] : cell.measure[q];
  }
  static MatrixD deformation(const double* F, int stride, int q) {
    MatrixD out;
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < d; ++j) out(i, j) = F[(i * d + j) * stride + q];
    return out;
  }
  static MatrixD left_factor(const double* factor) {
    if (factor == nullptr) return MatrixD::Identity();
    return Eigen::Map<const Eigen::Matrix<double, d, d, Eigen::RowMajor>>(factor);
  }
  static MatrixD inverse_target(const double* inverse, bool affine, int stride, int q) {
    MatrixD out;
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < d; ++j) out(i, j) = affine ? inverse[i * d + j] : inverse[(i * d + j) * stride + q];
    return out;
  }
  static VectorD gradient(const StarCell& cell, int q) {
    VectorD reference;
    for (int k = 0; k < d; ++k) reference[k] = cell.derivatives[k * cell.stride + q];
    return inverse_target(cell.inverse_target, cell.affine, cell.stride, q).transpose() * reference;
  }

  Material material_;
  bool barrier_;
};

}  // namespace

std::unique_ptr<Kernels> make_plain_kernels(const Material& material, int dimension) {
  if (dimension == 2) return std::make_unique<PlainKernels<2>>(material);
  return std::make_unique<PlainKernels<3>>(material);
}

}  // namespace varimesh
