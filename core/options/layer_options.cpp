#include "core/options/layer_options.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "core/options/option_table.h"

namespace varimesh {
namespace {

bool is_height(double height) { return std::isfinite(height) && height > 0; }

Expected<void> check_heights(const LayerOptions& options) {
  if (options.layers != 0 || options.first != 0 || options.growth != 0)
    return bad_option(
        "The layers have a list of heights and a number, first height or growth as well. Give either the list or "
        "the numbers.");
  if (options.heights.size() > kMostLayers)
    return bad_option("The list has " + std::to_string(options.heights.size()) + " heights; give at most " +
                      std::to_string(kMostLayers) + ".");
  if (!std::ranges::all_of(options.heights, is_height))
    return bad_option("A height of a layer is not a positive number. Give heights in the mesh's unit of length.");
  return {};
}

/// Checks what layers need of a thickness that is grown for them.
Expected<void> check_growth(const LayerOptions& options) {
  constexpr double kRounding = 1e-9;
  if (options.rows > 1)
    return bad_option("One row of thick cells is grown, and " + std::to_string(options.rows) +
                      " rows are to be split. Split one.");
  const double least =
      options.heights.empty() && options.fills() ? options.first * std::max(1, options.layers) : options.height();
  if (least > options.grow * (1 + kRounding))
    return bad_option("The layers are at least " + number_text(least) +
                      " high together, and the layer that is grown is " + number_text(options.grow) +
                      ". Grow a thicker one, or ask for fewer or lower layers.");
  const double rate = std::log(std::max(1.0, options.growth)), ratio = options.grow / options.first;
  if (options.layers == 0 && options.heights.empty() &&
      (rate < 1e-9 ? ratio : std::log1p(ratio * std::expm1(rate)) / rate) > kMostLayers)
    return bad_option("The grown layer would be split into more than " + std::to_string(kMostLayers) +
                      " layers. Ask for a larger first height or growth.");
  return {};
}

}  // namespace

double LayerOptions::height() const {
  if (!heights.empty()) return std::accumulate(heights.begin(), heights.end(), 0.0);
  double sum = 0, next = first;
  for (int layer = 0; layer < layers; ++layer, next *= growth == 0 ? 1 : growth) sum += next;
  return fills() ? 0 : sum;
}

Expected<void> check(const LayerOptions& options) {
  if (options.walls.empty())
    return bad_option("The layers have no wall. Name a group of boundary elements above which cells are split.");
  if (options.spacing == LayerSpacing::Keep)
    return bad_option("New layers have no spacing to keep. Choose even or graded.");
  for (const LayerOption& option : layer_option_table())
    if (const double value = number_of(option, options); is_number(option) && !option.range.contains(value))
      return bad_option(std::string(option.name) + " is " + number_text(value) + "; give " +
                        std::string(option.values) + ".");
  if (!options.heights.empty()) {
    const auto checked = check_heights(options);
    return checked && options.grow > 0 ? check_growth(options) : checked;
  }
  if (options.growth != 0 && options.growth < 1)
    return bad_option(
        "The growth of the layers is below 1. It is the height of each layer divided by the height of the layer below "
        "it; give 1 to 10.");
  const int given = (options.layers != 0 ? 1 : 0) + (options.first != 0 ? 1 : 0) + (options.growth != 0 ? 1 : 0);
  if (given < 2)
    return bad_option(
        "The heights of the layers are not known. Give two of the number of layers, the first height and the growth, "
        "or a list of heights.");
  // Lower ones are rounding errors.
  constexpr double kMostRatio = 1e15;
  if (options.growth > 1 && (options.layers - 1) * std::log(options.growth) > std::log(kMostRatio))
    return bad_option("The highest of " + std::to_string(options.layers) + " layers would be more than " +
                      number_text(kMostRatio) +
                      " times as high as the first. Ask for fewer layers or a smaller growth.");
  return options.grow > 0 ? check_growth(options) : Expected<void>();
}

}  // namespace varimesh
