#include "core/layers/split/layer_heights.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

/// The height of `layers` layers together, divided by the height of the first one.
double sum_of(int layers, double growth) {
  const double rate = std::log(growth);
  return std::abs(rate) < 1e-9 ? layers : std::expm1(layers * rate) / std::expm1(rate);
}

std::vector<double> geometric(int layers, double first, double growth) {
  std::vector<double> heights;
  for (int layer = 0; layer < layers; ++layer) heights.push_back(first * std::pow(growth, layer));
  return heights;
}

/// The growth with which layers fill a column that is `ratio` times as high as the first one.
double fitting_growth(int layers, double ratio) {
  double low = 1, high = 2;
  while (sum_of(layers, high) < ratio) high *= 2;
  for (int halving = 0; halving < 80; ++halving) {
    const double middle = (low + high) / 2;
    (sum_of(layers, middle) < ratio ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

int number_of_layers(const LayerOptions& wanted, double column) {
  if (!wanted.heights.empty()) return static_cast<int>(wanted.heights.size());
  if (wanted.layers != 0) return wanted.layers;
  const double ratio = column / wanted.first, rate = std::log(wanted.growth);
  const double layers = rate < 1e-9 ? ratio : std::log1p(ratio * std::expm1(rate)) / rate;
  // Not more than there is room for without layers that become lower.
  return static_cast<int>(
      std::clamp(std::round(layers), 1.0, std::clamp(std::floor(ratio * (1 + 1e-12)), 1.0, kMostLayers + 1.0)));
}

std::vector<double> heights_in_column(const LayerOptions& wanted, int layers, double column) {
  constexpr double kRounding = 1e-9;
  std::vector<double> heights = wanted.heights;
  if (heights.empty() && wanted.first == 0) {
    heights = geometric(layers, column / sum_of(layers, wanted.growth), wanted.growth);
  } else if (heights.empty() && wanted.fills()) {
    const bool fits = layers > 1 && layers * wanted.first <= column * (1 + kRounding);
    if (!fits && wanted.grow == 0 && layers > 1) return {};
    heights = fits ? geometric(layers, wanted.first, fitting_growth(layers, column / wanted.first))
                   : geometric(layers, column / layers, 1);
  } else if (heights.empty()) {
    heights = geometric(layers, wanted.first, wanted.growth == 0 ? 1 : wanted.growth);
  }
  if (wanted.grow > 0 && !wanted.fills())
    for (double& height : heights) height *= column / wanted.grow;
  return std::accumulate(heights.begin(), heights.end(), 0.0) <= column * (1 + kRounding) ? heights
                                                                                          : std::vector<double>();
}

}  // namespace varimesh::detail
