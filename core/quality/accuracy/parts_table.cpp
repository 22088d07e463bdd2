// Integrals by quadrature. All integrands are polynomials, on pyramids in collapsed coordinates, so the rules are
// exact.
#include "core/quality/accuracy/parts_table.h"

#include <Eigen/LU>
#include <algorithm>
#include <numeric>
#include <tuple>

#include "core/reference/cache.h"
#include "core/reference/modal.h"
#include "core/reference/quadrature.h"

namespace varimesh::detail {
namespace {

/// Tables of fewer nodes are made so fast that no look is needed.
constexpr Eigen::Index kColumns = 256;

/// The inverse, a block of columns at a time: of 1,331 modes it takes most of a second.
Eigen::MatrixXd inverse(const Eigen::MatrixXd& matrix, const StopToken* stop) {
  const Eigen::PartialPivLU<Eigen::MatrixXd> factors(matrix);
  Eigen::MatrixXd inverse = Eigen::MatrixXd::Identity(matrix.rows(), matrix.cols());
  for (Eigen::Index first = 0; first < matrix.cols(); first += kColumns) {
    if (first > 0) look(stop);
    auto columns = inverse.middleCols(first, std::min(kColumns, matrix.cols() - first));
    columns = factors.solve(Eigen::MatrixXd(columns));
  }
  return inverse;
}

PartsTable make_table(Shape shape, int order, reference::NodeSet set, const StopToken* stop) {
  const int d = reference::info(shape).dimension;
  const double measure = reference::info(shape).measure;
  const reference::Points& nodes = reference::nodes(shape, order, set, d);
  const reference::Quadrature rule = reference::quadrature(shape, order, 2 * order);
  const std::vector<int> degrees = reference::modal_degrees(shape, order);
  std::vector<int> modes(degrees.size());
  std::iota(modes.begin(), modes.end(), 0);
  std::ranges::stable_sort(modes, {}, [&](int mode) { return degrees[static_cast<std::size_t>(mode)]; });

  PartsTable table;
  const Eigen::MatrixXd coefficients = inverse(reference::modal_values(shape, order, nodes), stop);
  std::vector<Eigen::MatrixXd> gradients = reference::modal_gradients(shape, order, rule.points);
  table.mean_gradient.resize(d, nodes.rows());
  for (int a = 0; a < d; ++a)
    table.mean_gradient.row(a) = rule.weights.transpose() * gradients[static_cast<std::size_t>(a)] * coefficients;
  table.mean_gradient /= measure;

  const auto is_straight = [&](int mode) { return degrees[static_cast<std::size_t>(mode)] < 2; };
  modes.erase(modes.begin(), std::ranges::find_if_not(modes, is_straight));
  table.to_modes = coefficients(modes, Eigen::all);
  table.modes = modes;
  for (int s = 2; s <= order + 1; ++s)
    table.first.push_back(std::ranges::count_if(degrees, [&](int degree) { return degree >= 2 && degree < s; }));
  for (Eigen::MatrixXd& gradient : gradients)
    gradient = (rule.weights / measure).cwiseSqrt().asDiagonal() * Eigen::MatrixXd(gradient(Eigen::all, modes));
  for (std::size_t part = 0; part + 1 < table.first.size(); ++part) {
    if (nodes.rows() > kColumns) look(stop);
    const Eigen::Index first = table.first[part], count = table.first[part + 1] - first;
    std::vector<Eigen::MatrixXd>& products = table.products.emplace_back();
    for (int a = 0; a < d; ++a)
      for (int b = a; b < d; ++b) {
        const Eigen::MatrixXd product = gradients[static_cast<std::size_t>(a)].middleCols(first, count).transpose() *
                                        gradients[static_cast<std::size_t>(b)].middleCols(first, count);
        products.emplace_back((product + product.transpose()) / 2);
      }
  }
  return table;
}

}  // namespace

const PartsTable& parts_table(Shape shape, int order, reference::NodeSet set, const StopToken* stop) {
  static reference::Cache<std::tuple<Shape, int, reference::NodeSet>, PartsTable> tables;
  return tables.get({shape, order, set}, [&] { return make_table(shape, order, set, stop); });
}

}  // namespace varimesh::detail
