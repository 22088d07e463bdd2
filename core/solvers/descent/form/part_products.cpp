// Sums run over nodes, modes and entries in ascending order, lane by lane. The result of a cell therefore depends on
// the machine's vector unit only by its fused multiplications, and not on the cells beside it.
#include "core/solvers/descent/form/part_products.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "core/base/index.h"
#include "core/quality/accuracy/parts_table.h"
#include "core/reference/cache.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "core/solvers/descent/form/part_products.cpp"
#include <hwy/foreach_target.h>  // IWYU pragma: keep

#include "core/kernels/dense/lane_matrix-inl.h"

HWY_BEFORE_NAMESPACE();
namespace varimesh::detail::parts::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using lanes::HWY_NAMESPACE::MultiplyVector;
using lanes::HWY_NAMESPACE::Tag;
using lanes::HWY_NAMESPACE::V;

/// The slopes of q by modes; returns q.
template <std::size_t D>
HWY_INLINE V Slopes(const PartProducts& of, const double* HWY_RESTRICT weights, const double* HWY_RESTRICT metrics,
                    const double* HWY_RESTRICT modes, double* HWY_RESTRICT slopes) {
  const Tag tag;
  constexpr std::size_t kPairs = D * (D + 1) / 2;
  V metric[kPairs];
  for (std::size_t pair = 0; pair < kPairs; ++pair) metric[pair] = hn::LoadU(tag, metrics + pair * kCellLanes);
  V value = hn::Zero(tag);
  for (std::size_t m = 0; m < of.modes; ++m) {
    V sum[D];
    for (std::size_t k = 0; k < D; ++k) sum[k] = hn::Zero(tag);
    for (std::size_t i = of.first[m]; i < of.first[m + 1]; ++i) {
      const double* HWY_RESTRICT entry = of.entries.data() + i * kPairs;
      V weight = hn::Mul(hn::Set(tag, entry[0]), metric[0]);
      for (std::size_t pair = 1; pair < kPairs; ++pair)
        weight = hn::MulAdd(hn::Set(tag, entry[pair]), metric[pair], weight);
      const double* HWY_RESTRICT mode = modes + of.columns[i] * D * kCellLanes;
      for (std::size_t k = 0; k < D; ++k) sum[k] = hn::MulAdd(weight, hn::LoadU(tag, mode + k * kCellLanes), sum[k]);
    }
    const V of_degree = hn::Set(tag, weights[m]);
    for (std::size_t k = 0; k < D; ++k) {
      sum[k] = hn::Mul(of_degree, sum[k]);
      value = hn::MulAdd(sum[k], hn::LoadU(tag, modes + (m * D + k) * kCellLanes), value);
      hn::StoreU(hn::Add(sum[k], sum[k]), tag, slopes + (m * D + k) * kCellLanes);
    }
  }
  return value;
}

template <std::size_t D>
void DifferentiateIn(const PartProducts& of, const double* weights, const double* metrics, const double* x,
                     double* room, double* values, double* slopes) {
  const Tag tag;
  double* const modes = room + of.to_modes.there.room(D);
  double* const of_modes = modes + of.modes * D * kCellLanes;
  for (std::size_t lane = 0; lane < kCellLanes; lane += hn::Lanes(tag)) {
    MultiplyVector<D>(of.to_modes.there, x + lane, modes + lane, room + lane);
    hn::StoreU(Slopes<D>(of, weights, metrics + lane, modes + lane, of_modes + lane), tag, values + lane);
    MultiplyVector<D>(of.to_modes.back, of_modes + lane, slopes + lane, room + lane);
  }
}

void Differentiate(const PartProducts& of, const double* weights, const double* metrics, const double* x, double* room,
                   double* values, double* slopes) {
  if (of.d == 2)
    DifferentiateIn<2>(of, weights, metrics, x, room, values, slopes);
  else
    DifferentiateIn<3>(of, weights, metrics, x, room, values, slopes);
}

}  // namespace varimesh::detail::parts::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace varimesh::detail {
namespace parts {
HWY_EXPORT(Differentiate);

/// Entries below this share of the largest one are rounding.
constexpr double kNothing = 1e-14;

PartProducts make_products(Shape shape, int order) {
  const PartsTable& table = parts_table(shape, order, reference::NodeSet::Optimised);
  PartProducts made;
  made.d = at(reference::info(shape).dimension);
  made.pairs = made.d * (made.d + 1) / 2;
  made.nodes = at(table.to_modes.cols());
  made.modes = at(table.to_modes.rows());
  made.to_modes = to_modes(shape, order);
  made.first.push_back(0);
  for (std::size_t part = 0; part < table.products.size(); ++part) {
    const std::vector<Eigen::MatrixXd>& products = table.products[part];
    double largest = 0;
    for (const Eigen::MatrixXd& product : products) largest = std::max(largest, product.cwiseAbs().maxCoeff());
    const auto is_zero = [&](Eigen::Index m, Eigen::Index n) {
      return std::ranges::all_of(products,
                                 [&](const Eigen::MatrixXd& of) { return std::abs(of(m, n)) <= kNothing * largest; });
    };
    for (Eigen::Index m = 0; m < products.front().rows(); ++m) {
      for (Eigen::Index n = 0; n < products.front().cols(); ++n) {
        if (is_zero(m, n)) continue;
        made.columns.push_back(at(table.first[part] + n));
        for (std::size_t a = 0, pair = 0; a < made.d; ++a)
          for (std::size_t b = a; b < made.d; ++b, ++pair)
            made.entries.push_back((a == b ? 1 : 2) * products[pair](m, n));
      }
      made.first.push_back(made.columns.size());
      made.degrees.push_back(static_cast<int>(part) + 2);
    }
  }
  return made;
}

}  // namespace parts

const PartProducts& part_products(Shape shape, int order) {
  static reference::Cache<std::tuple<Shape, int>, PartProducts> tables;
  return tables.get({shape, order}, [&] { return parts::make_products(shape, order); });
}

void differentiate_parts(const PartProducts& products, const double* weights, const double* metrics, const double* x,
                         std::vector<double>& room, double* values, double* slopes) {
  const std::size_t needed = products.to_modes.there.room(products.d) + 2 * products.modes * products.d * kCellLanes;
  if (room.size() < needed) room.resize(needed);
  HWY_DYNAMIC_DISPATCH(parts::Differentiate)(products, weights, metrics, x, room.data(), values, slopes);
}

}  // namespace varimesh::detail
#endif
