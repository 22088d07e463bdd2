// The batched kernel, compiled for every vector unit that Highway knows on this architecture. Each lane is a cell.
#include "core/validity/certificate_kernel.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/validity/rounding.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/validity/certificate_kernel.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep
#include <hwy/highway.h>

#include "core/validity/formulas/coefficients-inl.h"
#include "core/validity/formulas/rounding_bound-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::HWY_NAMESPACE {

std::size_t Lanes() { return hn::Lanes(D()); }

/// The arrays in the workspace, each [coefficient][component][lane].
struct Arrays {
  double* nodes;
  double* map;
  std::array<double*, 3> derivative;
  double* cross;
  double* jacobian;
};

Arrays divide(const JacobianTable& table, std::size_t lanes, std::vector<double>& workspace) {
  const auto d = static_cast<std::size_t>(table.dimension);
  const auto doubles = [&](int coefficients, std::size_t components) {
    return static_cast<std::size_t>(coefficients) * components * lanes;
  };
  std::size_t needed = doubles(table.nodes + table.map.size(), d) + doubles(table.jacobian.size(), 1) +
                       doubles(table.cross.size(), 3) + kMostLanes;
  for (std::size_t r = 0; r < d; ++r) needed += doubles(table.derivative[r].size(), d);
  if (workspace.size() < needed) workspace.resize(needed);
  // Vectors are aligned by hand; the widest hold 32 doubles.
  auto address = reinterpret_cast<std::uintptr_t>(workspace.data());
  const std::uintptr_t step = sizeof(double) * lanes;
  address = (address + step - 1) / step * step;
  auto* at = reinterpret_cast<double*>(address);
  const auto take = [&](std::size_t count) { return std::exchange(at, at + count); };
  Arrays arrays{};
  arrays.nodes = take(doubles(table.nodes, d));
  arrays.map = take(doubles(table.map.size(), d));
  for (std::size_t r = 0; r < d; ++r) arrays.derivative[r] = take(doubles(table.derivative[r].size(), d));
  arrays.cross = take(doubles(table.cross.size(), 3));
  arrays.jacobian = take(doubles(table.jacobian.size(), 1));
  return arrays;
}

/// Coordinates relative to each cell's first node, lane by lane. Lanes without a cell repeat the last one.
void Gather(const KernelInput& input, std::size_t lanes, double* out) {
  const int d = input.table->dimension, nodes = input.table->nodes;
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::int32_t* list = input.nodes[std::min(lane, input.cells - 1)];
    const double* origin = input.coordinates + 3 * static_cast<std::size_t>(list[0]);
    double* to = out + lane;
    for (int n = 0; n < nodes; ++n) {
      const double* x = input.coordinates + 3 * static_cast<std::size_t>(list[n]);
      for (int c = 0; c < d; ++c, to += lanes) *to = (x[c] - origin[c]) * input.scale;
    }
  }
}

Entries entries(const std::vector<std::uint32_t>& start, int row) {
  return {start[static_cast<std::size_t>(row)], start[static_cast<std::size_t>(row) + 1]};
}
const std::uint16_t* pairs(const Convolution& terms) { return terms.pairs.data()->data(); }

/// Scaled coefficients of χ.
template <int kDim>
void Convert(const JacobianTable& table, const double* HWY_RESTRICT nodes, double* HWY_RESTRICT map) {
  const std::size_t lanes = Lanes();
  for (int row = 0; row < table.map.size(); ++row)
    ConvertRow<kDim>(table.value.data(), table.column.data(), entries(table.row_start, row), nodes, lanes,
                     map + row * kDim * lanes);
}

/// Scaled coefficients of g_r, and the largest control point of each component.
template <int kDim>
void Differentiate(const JacobianTable& table, int r, const double* HWY_RESTRICT map, double* HWY_RESTRICT derivative,
                   double* HWY_RESTRICT size) {
  const D d;
  const std::size_t lanes = Lanes();
  V most[kDim];
  for (V& m : most) m = hn::Zero(d);
  const auto& differences = table.difference[r];
  for (std::size_t i = 0; i < differences.size(); ++i) {
    const Difference& one = differences[i];
    const V reciprocal = hn::Set(d, table.derivative_reciprocal[r][i]);
    for (int c = 0; c < kDim; ++c) {
      const V g = DifferenceOf(one.plus_weight, map + (one.plus * kDim + c) * lanes, one.minus_weight,
                               map + (one.minus * kDim + c) * lanes);
      hn::Store(g, d, derivative + (i * kDim + c) * lanes);
      most[c] = hn::Max(most[c], hn::Mul(hn::Abs(g), reciprocal));
    }
  }
  for (int c = 0; c < kDim; ++c) hn::Store(most[c], d, size + c * lanes);
}

/// g_1 × g_2 in scaled coefficients.
void Cross(const JacobianTable& table, const double* HWY_RESTRICT a, const double* HWY_RESTRICT b,
           double* HWY_RESTRICT cross) {
  const std::size_t lanes = Lanes();
  for (int k = 0; k < table.cross.size(); ++k)
    CrossRow(pairs(table.cross_terms), entries(table.cross_terms.start, k), a, b, lanes, cross + k * 3 * lanes);
}

/// Largest absolute coordinate of each component. `probe` is NaN if a coordinate is not finite, else 0.
template <int kDim>
void Extents(const JacobianTable& table, const double* HWY_RESTRICT nodes, double* HWY_RESTRICT extent,
             double* HWY_RESTRICT probe) {
  const D d;
  const std::size_t lanes = Lanes();
  V sum = hn::Zero(d), most[kDim];
  for (V& m : most) m = sum;
  const V zero = hn::Zero(d);
  for (int n = 0; n < table.nodes; ++n) {
    for (int c = 0; c < kDim; ++c) {
      const V x = hn::Load(d, nodes + (n * kDim + c) * lanes);
      most[c] = hn::Max(most[c], hn::Abs(x));
      sum = hn::MulAdd(x, zero, sum);
    }
  }
  for (int c = 0; c < kDim; ++c) hn::Store(most[c], d, extent + c * lanes);
  hn::Store(sum, d, probe);
}

struct Number {
  HWY_INLINE V operator()(double c) const { return hn::Set(D(), c); }
};

/// The bound on the error of each lane's coefficients. `measure` holds the sizes of the derivatives [r][c][lane], the
/// extents [c][lane] and the probe [lane].
template <int kDim>
V Error(const JacobianTable& table, const double* HWY_RESTRICT measure) {
  constexpr double unit = std::numeric_limits<double>::epsilon() / 2;
  const D d;
  const std::size_t lanes = Lanes();
  const double* extent = measure + kDim * kDim * lanes;
  V sizes[3][3], errors[3][3];
  for (int r = 0; r < kDim; ++r) {
    const V conversion = hn::Set(d, relative_rounding(table.conversion_roundings, unit) * table.condition[r]);
    for (int c = 0; c < kDim; ++c) {
      sizes[r][c] = hn::Load(d, measure + (r * kDim + c) * lanes);
      errors[r][c] = conversion * hn::Load(d, extent + c * lanes);
    }
  }
  const V product = hn::Set(d, relative_rounding(table.product_roundings, unit));
  return rounding_bound<kDim>(sizes, errors, product, Number()) + hn::Load(d, extent + kDim * lanes);
}

template <int kDim>
void Run(const KernelInput& input, std::vector<double>& workspace, KernelOutput& output) {
  const D d;
  const std::size_t lanes = Lanes();
  const JacobianTable& table = *input.table;
  const Arrays arrays = divide(table, lanes, workspace);
  HWY_ALIGN double measure[13 * kMostLanes];
  Gather(input, lanes, arrays.nodes);
  Convert<kDim>(table, arrays.nodes, arrays.map);
  for (int r = 0; r < kDim; ++r)
    Differentiate<kDim>(table, r, arrays.map, arrays.derivative[r],
                        measure + static_cast<std::size_t>(r) * kDim * lanes);
  double* extent = measure + kDim * kDim * lanes;
  Extents<kDim>(table, arrays.nodes, extent, extent + kDim * lanes);
  if constexpr (kDim == 3) Cross(table, arrays.derivative[1], arrays.derivative[2], arrays.cross);
  const double* right = kDim == 3 ? arrays.cross : arrays.derivative[1];
  V least = hn::Set(d, std::numeric_limits<double>::max()), greatest = hn::Neg(least);
  for (int k = 0; k < table.jacobian.size(); ++k) {
    const V scaled = Coefficient<kDim>(pairs(table.jacobian_terms), entries(table.jacobian_terms.start, k),
                                       arrays.derivative[0], right, lanes);
    const V value = hn::Mul(scaled, hn::Set(d, table.jacobian_reciprocal[k] * input.sign));
    hn::Store(value, d, arrays.jacobian + k * lanes);
    least = hn::Min(least, value);
    greatest = hn::Max(greatest, value);
  }
  hn::StoreU(least, d, output.least.data());
  hn::StoreU(greatest, d, output.greatest.data());
  for (std::size_t k = 0; k < table.corners.size(); ++k)
    hn::StoreU(hn::Load(d, arrays.jacobian + table.corners[k] * lanes), d, output.corner[k].data());
  output.coefficients = arrays.jacobian;
  hn::StoreU(Error<kDim>(table, measure), d, output.error.data());
}

/// The output for cells that were measured elsewhere.
template <int kDim>
void Judge(const JacobianTable& table, const double* measures, std::size_t stride, std::size_t cells,
           KernelOutput& output) {
  constexpr std::size_t kSizes = kDim * kDim + kDim + 1;
  HWY_ALIGN double measure[13 * kMostLanes];
  const std::size_t lanes = Lanes();
  const auto take = [&](std::size_t number, double* to) {
    for (std::size_t lane = 0; lane < lanes; ++lane) to[lane] = measures[number * stride + std::min(lane, cells - 1)];
  };
  for (std::size_t i = 0; i < kSizes; ++i) take(i, measure + i * lanes);
  take(kSizes, output.least.data());
  take(kSizes + 1, output.greatest.data());
  for (std::size_t k = 0; k < table.corners.size(); ++k) take(kSizes + 2 + k, output.corner[k].data());
  output.coefficients = nullptr;
  hn::StoreU(Error<kDim>(table, measure), D(), output.error.data());
}

void JudgeMeasures(const JacobianTable& table, const double* measures, std::size_t stride, std::size_t cells,
                   KernelOutput& output) {
  if (table.dimension == 2)
    Judge<2>(table, measures, stride, cells, output);
  else
    Judge<3>(table, measures, stride, cells, output);
}

void Kernel(const KernelInput& input, std::vector<double>& workspace, KernelOutput& output) {
  if (input.table->dimension == 2)
    Run<2>(input, workspace, output);
  else
    Run<3>(input, workspace, output);
}

}  // namespace varimesh::detail::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh::detail {

HWY_EXPORT(Kernel);
HWY_EXPORT(JudgeMeasures);
HWY_EXPORT(Lanes);

std::size_t kernel_lanes() { return HWY_DYNAMIC_DISPATCH(Lanes)(); }

void bernstein_kernel(const KernelInput& input, std::vector<double>& workspace, KernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(Kernel)(input, workspace, output);
}

void judge_measures(const JacobianTable& table, const double* measures, std::size_t stride, std::size_t cells,
                    KernelOutput& output) {
  HWY_DYNAMIC_DISPATCH(JudgeMeasures)(table, measures, stride, cells, output);
}

}  // namespace varimesh::detail
#endif  // HWY_ONCE
