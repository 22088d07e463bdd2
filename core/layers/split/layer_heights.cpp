#include "core/layers/split/layer_heights.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "core/base/index.h"

namespace varimesh {
namespace {

/// The height of `layers` layers over the height of the first one.
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

bool is_height(double height) { return std::isfinite(height) && height > 0; }

}  // namespace

Expected<void> check(const LayerHeights& wanted) {
  if (wanted.layers < 0 || wanted.layers > kMostLayers || wanted.heights.size() > kMostLayers)
    return bad_option("The number of layers is " + std::to_string(wanted.layers) + "; give 1 to " +
                      std::to_string(kMostLayers) + ".");
  if (!wanted.heights.empty()) {
    if (wanted.layers != 0 || wanted.first != 0 || wanted.growth != 0)
      return bad_option(
          "The layers have a list of heights and a number, first height or growth as well. Give either the list or "
          "the numbers.");
    if (!std::ranges::all_of(wanted.heights, is_height))
      return bad_option("A height of a layer is not a positive number. Give heights in the mesh's unit of length.");
    return {};
  }
  if (wanted.first != 0 && !is_height(wanted.first))
    return bad_option("The first height is not a positive number. Give it in the mesh's unit of length.");
  if (wanted.growth != 0 && !(wanted.growth >= 1 && wanted.growth <= 10))
    return bad_option(
        "The growth of the layers is not between 1 and 10. It is the height of each layer over the height "
        "of the one below.");
  const int given = (wanted.layers != 0 ? 1 : 0) + (wanted.first != 0 ? 1 : 0) + (wanted.growth != 0 ? 1 : 0);
  if (given < 2)
    return bad_option(
        "The heights of the layers are not known. Give two of the number of layers, the first height and the growth, "
        "or a list of heights.");
  return {};
}

namespace detail {

int number_of_layers(const LayerHeights& wanted, double column) {
  if (!wanted.heights.empty()) return static_cast<int>(wanted.heights.size());
  if (wanted.layers != 0) return wanted.layers;
  const double ratio = column / wanted.first, rate = std::log(wanted.growth);
  const double layers = rate < 1e-9 ? ratio : std::log1p(ratio * std::expm1(rate)) / rate;
  // Not more than there is room for without layers that become lower.
  return static_cast<int>(std::clamp(std::round(layers), 1.0, std::max(1.0, std::floor(ratio * (1 + 1e-12)))));
}

std::vector<double> heights_in_column(const LayerHeights& wanted, int layers, double column) {
  constexpr double kRounding = 1e-9;
  std::vector<double> heights = wanted.heights;
  if (heights.empty() && wanted.first == 0) {
    heights = geometric(layers, column / sum_of(layers, wanted.growth), wanted.growth);
  } else if (heights.empty() && wanted.fills() && layers > 1) {
    if (layers * wanted.first > column * (1 + kRounding)) return {};
    heights = geometric(layers, wanted.first, fitting_growth(layers, column / wanted.first));
  } else if (heights.empty()) {
    heights = geometric(layers, wanted.first, wanted.growth == 0 ? 1 : wanted.growth);
  }
  if (std::accumulate(heights.begin(), heights.end(), 0.0) > column * (1 + kRounding)) return {};
  return heights;
}

}  // namespace detail
}  // namespace varimesh
