// A new kind of target is one function of TargetInputs and one line in kTargets.
#include "core/problem/targets.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <numeric>

#include "core/problem/regular_shape.h"
#include "core/problem/sizes.h"
#include "core/reference/basis.h"
#include "core/reference/quadrature.h"

namespace varimesh {
namespace {

constexpr std::size_t kCellsPerTask = 1024;

template <int d>
using MatrixD = Eigen::Matrix<double, d, d>;

// === The targets =========================================================================================

// What a target can depend on, at one quadrature point of one cell.
template <int d>
struct TargetInputs {
  MatrixD<d> straight;  // ∇χ_L at the point
  MatrixD<d> stretch;   // S at the point, 1 without a field; only its size if L has the rest
  MatrixD<d> regular;   // W
  MatrixD<d> rotation;  // R of the cell
  double edge = 0;      // edge length of the regular shape with the volume of the straight-sided cell
};

template <int d>
MatrixD<d> straight_sided(const TargetInputs<d>& cell) {
  return cell.straight;
}

template <int d>
MatrixD<d> ideal(const TargetInputs<d>& cell) {
  return cell.edge * cell.rotation * cell.regular;
}

template <int d>
MatrixD<d> sized(const TargetInputs<d>& cell) {
  return cell.stretch * cell.rotation * cell.regular;
}

template <int d>
MatrixD<d> strained(const TargetInputs<d>& cell) {
  return cell.stretch * cell.straight;
}

struct TargetEntry {
  Target target;
  bool is_regular;  // depends on W, so that the rotation and the edge are needed
  MatrixD<2> (*plane)(const TargetInputs<2>&);
  MatrixD<3> (*solid)(const TargetInputs<3>&);
};

constexpr TargetEntry kTargets[] = {
    {Target::StraightSided, false, straight_sided<2>, straight_sided<3>},
    {Target::Ideal, true, ideal<2>, ideal<3>},
    {Target::Size, true, sized<2>, sized<3>},
    {Target::Strain, false, strained<2>, strained<3>},
};

const TargetEntry& entry_of(Target target) {
  for (const TargetEntry& entry : kTargets)
    if (entry.target == target) return entry;
  assert(false && "a target that is not in the table");
  return kTargets[0];
}

// === Targets of one set ==================================================================================

// The values of a field on the cells of a set.
struct FieldOnSet {
  const StretchField& field;
  const std::vector<std::int32_t>& mesh_cell;  // numbers of the cells in the mesh's order
  Eigen::MatrixXd vertex_values;               // points × vertices
  double scale = 1;                            // from the field's unit to the problem's

  template <int d>
  MatrixD<d> entry(std::size_t index) const {
    const double* value = field.values.data() + index * std::size_t(field.components);
    if (field.components == 1) return scale * value[0] * MatrixD<d>::Identity();
    MatrixD<d> S;
    for (int i = 0, k = 0; i < d; ++i)
      for (int j = 0; j <= i; ++j, ++k) S(i, j) = S(j, i) = scale * value[k];
    return S;
  }

  template <int d>
  MatrixD<d> at(const std::int32_t* nodes, std::int32_t cell, int point) const {
    if (field.components == 0) return MatrixD<d>::Identity();
    if (field.per == Per::Cell) return entry<d>(mesh_cell[std::size_t(cell)]);
    MatrixD<d> S = MatrixD<d>::Zero();
    for (int v = 0; v < vertex_values.cols(); ++v)
      S += vertex_values(point, v) * entry<d>(static_cast<std::size_t>(nodes[v]));
    return S;
  }
};

// The edge of a cube with the volume of the unit cube stretched by S.
template <int d>
double size_of(const MatrixD<d>& stretch) {
  return std::pow(stretch.determinant(), 1.0 / d);
}

// The orthogonal factor of a matrix. Its determinant has the sign of the matrix's determinant.
template <int d>
MatrixD<d> polar_rotation(const MatrixD<d>& matrix) {
  const Eigen::JacobiSVD<MatrixD<d>> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return svd.matrixU() * svd.matrixV().transpose();
}

// The orthogonal matrix closest to `rotation` that takes the coordinate axes to eigenvectors of `stretch` and has a
// determinant of the same sign as `rotation`.
template <int d>
MatrixD<d> along_axes(const MatrixD<d>& stretch, const MatrixD<d>& rotation) {
  const MatrixD<d> axes = Eigen::SelfAdjointEigenSolver<MatrixD<d>>(stretch).eigenvectors();
  const MatrixD<d> wanted = axes.transpose() * rotation;  // `rotation` in the eigenvectors' coordinates
  MatrixD<d> best = rotation;
  double closest = -1;
  std::array<int, d> order{};
  std::iota(order.begin(), order.end(), 0);
  do {
    for (int signs = 0; signs < (1 << d); ++signs) {
      MatrixD<d> turn = MatrixD<d>::Zero();
      for (int i = 0; i < d; ++i) turn(order[i], i) = (signs >> i & 1) != 0 ? -1 : 1;
      const double likeness = turn.cwiseProduct(wanted).sum();
      if (turn.determinant() * wanted.determinant() < 0 || likeness <= closest) continue;
      closest = likeness;
      best = axes * turn;
    }
  } while (std::next_permutation(order.begin(), order.end()));
  return best;
}

bool has_axes(Shape shape) {
  return shape == Shape::Quadrilateral || shape == Shape::Prism || shape == Shape::Hexahedron;
}

template <int d>
class TargetSetter {
 public:
  TargetSetter(const Problem& problem, CellSet& set, const TargetEntry& target, const FieldOnSet& field,
               const SubstituteShapes& substitutes, double diagonal)
      : problem_(problem),
        substitutes_(substitutes),
        diagonal_(diagonal),
        set_(set),
        target_(target),
        field_(field),
        rule_(reference::quadrature(set.shape, set.order, set.degree)),
        gradients_(
            reference::basis_gradients(set.shape, 1, reference::NodeSet::Equispaced, set.dimension, rule_.points)),
        straight_(static_cast<std::size_t>(set.points)),
        turns_freely_(target.target == Target::Size && field.field.components > 1 && !has_axes(set.shape)) {
    inputs_.regular = regular_shape(set.shape).template topLeftCorner<d, d>();
  }

  void set_all(const Team& team) {
    const bool varies = field_.field.components > 0 && field_.field.per == Per::Vertex;
    set_.affine = reference::info(set_.shape).affine && !varies;
    per_cell_ = set_.affine ? 1 : set_.stride;
    set_.inverse_target.resize(static_cast<std::size_t>(set_.count) * d * d * per_cell_);
    set_.measure.resize(static_cast<std::size_t>(set_.count) * per_cell_);
    set_.left_factor.resize(turns_freely_ ? static_cast<std::size_t>(set_.count) * d * d : 0);
    team.for_ranges(static_cast<std::size_t>(set_.count), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      TargetSetter own = *this;  // the inputs of a cell are members
      for (std::size_t cell = begin; cell < end; ++cell) own.set_cell(static_cast<std::int32_t>(cell));
    });
  }

 private:
  void set_cell(std::int32_t cell) {
    const std::int32_t* nodes = set_.nodes.data() + static_cast<std::size_t>(cell) * set_.nodes_per_cell;
    double* inverse = set_.inverse_target.data() + static_cast<std::size_t>(cell) * d * d * per_cell_;
    double* measure = set_.measure.data() + static_cast<std::size_t>(cell) * per_cell_;
    const int points = std::min(per_cell_, set_.points);
    const SubstituteShapes::Vertices* substitute = substitutes_.of(set_.mesh_cell[static_cast<std::size_t>(cell)]);
    for (int q = 0; q < points; ++q)
      straight_[q] = substitute != nullptr ? substitute_gradient(*substitute, q) : straight_gradient(nodes, q);
    if (target_.is_regular) fit_regular(nodes, cell, points);
    for (int q = 0; q < per_cell_; ++q) {
      const int point = std::min(q, points - 1);
      inputs_.straight = straight_[point];
      inputs_.stretch = field_.at<d>(nodes, cell, point);
      if (turns_freely_) inputs_.stretch = size_of<d>(inputs_.stretch) * MatrixD<d>::Identity();
      const MatrixD<d> A = evaluate();
      const MatrixD<d> inverse_A = A.inverse();
      for (int i = 0; i < d; ++i)
        for (int j = 0; j < d; ++j) inverse[(i * d + j) * per_cell_ + q] = inverse_A(i, j);
      measure[q] = std::abs(A.determinant()) * (set_.affine ? 1.0 : set_.weights[q]);
    }
  }

  MatrixD<d> evaluate() const {
    if constexpr (d == 2)
      return target_.plane(inputs_);
    else
      return target_.solid(inputs_);
  }

  MatrixD<d> straight_gradient(const std::int32_t* nodes, int point) const {
    MatrixD<d> A = MatrixD<d>::Zero();
    for (int v = 0; v < reference::info(set_.shape).vertices; ++v)
      for (int k = 0; k < d; ++k)
        for (int i = 0; i < d; ++i) A(i, k) += problem_.positions[nodes[v] * d + i] * gradients_[k](point, v);
    return A;
  }

  MatrixD<d> substitute_gradient(const SubstituteShapes::Vertices& vertices, int point) const {
    MatrixD<d> A = MatrixD<d>::Zero();
    for (int v = 0; v < reference::info(set_.shape).vertices; ++v)
      for (int k = 0; k < d; ++k)
        for (int i = 0; i < d; ++i) A(i, k) += vertices[v][i] / diagonal_ * gradients_[k](point, v);
    return A;
  }

  // Sets the rotation, the edge and the left factor from means over the cell.
  void fit_regular(const std::int32_t* nodes, std::int32_t cell, int points) {
    MatrixD<d> straight = MatrixD<d>::Zero(), stretch = MatrixD<d>::Zero();
    double weight = 0, volume = 0;
    for (int q = 0; q < points; ++q) {
      weight += rule_.weights[q];
      volume += rule_.weights[q] * std::abs(straight_[q].determinant());
      straight += rule_.weights[q] * straight_[q];
      stretch += rule_.weights[q] * field_.at<d>(nodes, cell, q);
    }
    inputs_.rotation = polar_rotation<d>(stretch.inverse() * straight * inputs_.regular.inverse());
    if (turns_freely_) set_left_factor(cell, stretch);
    if (field_.field.components > 1 && has_axes(set_.shape))
      inputs_.rotation = along_axes<d>(stretch, inputs_.rotation);
    inputs_.edge = std::pow(volume / (weight * inputs_.regular.determinant()), 1.0 / d);
  }

  // L does not depend on the size of the stretch, so `stretch` may be the sum over the points instead of their mean.
  void set_left_factor(std::int32_t cell, const MatrixD<d>& stretch) {
    const MatrixD<d> factor = size_of<d>(stretch) * stretch.inverse();
    double* out = set_.left_factor.data() + static_cast<std::size_t>(cell) * d * d;
    for (int i = 0; i < d; ++i)
      for (int j = 0; j < d; ++j) out[i * d + j] = factor(std::max(i, j), std::min(i, j));
  }

  const Problem& problem_;
  const SubstituteShapes& substitutes_;
  double diagonal_;
  CellSet& set_;
  const TargetEntry& target_;
  const FieldOnSet& field_;
  reference::Quadrature rule_;
  std::vector<Eigen::MatrixXd> gradients_;
  std::vector<MatrixD<d>> straight_;
  bool turns_freely_ = false;  // a simplex or pyramid in a metric: L has the directions of the metric
  TargetInputs<d> inputs_;
  int per_cell_ = 1;
};

// === Targets that are the same at all points of a cell ===================================================

constexpr double kRounding = 1e-13;

// Whether all n numbers equal the first one up to rounding of `scale`.
bool all_alike(const double* numbers, int n, double scale) {
  return std::all_of(numbers, numbers + n, [&](double x) { return std::abs(x - numbers[0]) <= kRounding * scale; });
}

// Row k of A⁻¹ measures the map's direction k. In a thin cell the sizes of the rows are far apart, so each has its own
// scale.
bool is_uniform(const CellSet& set, std::int32_t cell) {
  const int d = set.dimension;
  const double *inverse = set.inverse_target_of(cell), *measure = set.measure_of(cell);
  for (int k = 0; k < d; ++k) {
    double scale = 0;
    for (int j = 0; j < d; ++j) scale = std::max(scale, std::abs(inverse[(k * d + j) * set.stride]));
    for (int j = 0; j < d; ++j)
      if (!all_alike(inverse + (k * d + j) * set.stride, set.points, scale)) return false;
  }
  const double volume = measure[0] / set.weights[0];
  for (int q = 0; q < set.points; ++q)
    if (!(std::abs(measure[q] - volume * set.weights[q]) <= kRounding * measure[q])) return false;
  return true;
}

void find_uniform_targets(CellSet& set, const Team& team) {
  set.uniform_target.clear();
  if (set.affine) return;
  const auto square = static_cast<std::size_t>(set.dimension * set.dimension);
  set.uniform_target.resize(static_cast<std::size_t>(set.count) * (square + 1));
  team.for_each(set.count, static_cast<std::int32_t>(kCellsPerTask), [&](std::int32_t cell) {
    if (!is_uniform(set, cell)) return;
    double* out = set.uniform_target.data() + static_cast<std::size_t>(cell) * (square + 1);
    for (std::size_t k = 0; k < square; ++k) out[k] = set.inverse_target_of(cell)[k * set.stride];
    out[square] = set.measure_of(cell)[0] / set.weights[0];
  });
}

}  // namespace

void set_targets(Problem& problem, const StretchField& field, double diagonal, const SubstituteShapes& substitutes,
                 const Team& team) {
  const TargetEntry& target = entry_of(field.target);
  for (CellSet& set : problem.sets) {
    FieldOnSet on_set{field, set.mesh_cell, {}, field.target == Target::Size ? 1 / diagonal : 1.0};
    if (field.components > 0 && field.per == Per::Vertex)
      on_set.vertex_values = reference::basis_values(set.shape, 1, reference::NodeSet::Equispaced, set.dimension,
                                                     reference::quadrature(set.shape, set.order, set.degree).points);
    if (problem.dimension == 2)
      TargetSetter<2>(problem, set, target, on_set, substitutes, diagonal).set_all(team);
    else
      TargetSetter<3>(problem, set, target, on_set, substitutes, diagonal).set_all(team);
    find_uniform_targets(set, team);
  }
  set_sizes(problem, team);
}

void level_targets(Problem& problem) {
  for (CellSet& set : problem.sets) {
    if (set.affine) continue;
    const auto d = static_cast<std::size_t>(problem.dimension), stride = static_cast<std::size_t>(set.stride);
    const double weight = std::accumulate(set.weights.begin(), set.weights.end(), 0.0);
    for (std::size_t cell = 0; cell < static_cast<std::size_t>(set.count); ++cell) {
      double* inverse = set.inverse_target.data() + cell * d * d * stride;
      double* measure = set.measure.data() + cell * stride;
      const double mean = std::accumulate(measure, measure + stride, 0.0) / weight;
      for (std::size_t q = 0; q < stride; ++q) {
        Eigen::Matrix3d at = Eigen::Matrix3d::Identity();
        for (std::size_t i = 0; i < d; ++i)
          for (std::size_t j = 0; j < d; ++j) at(i, j) = inverse[(i * d + j) * stride + q];
        const double scale = std::pow(mean * std::abs(at.determinant()), -1.0 / static_cast<double>(d));
        for (std::size_t k = 0; k < d * d; ++k) inverse[k * stride + q] *= scale;
        measure[q] = mean * set.weights[q];
      }
    }
    find_uniform_targets(set, Team(1));
  }
}

void set_straight_sided_targets(Problem& problem) { set_targets(problem, {}, 1.0); }

}  // namespace varimesh
