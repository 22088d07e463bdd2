#include "core/options/layer_options.h"

#include <algorithm>
#include <cmath>
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

}  // namespace

Expected<void> check(const LayerOptions& options) {
  if (options.walls.empty())
    return bad_option("The layers have no wall. Name a group of boundary elements above which cells are split.");
  if (options.spacing == LayerSpacing::Keep)
    return bad_option("New layers have no spacing to keep. Choose even or graded.");
  for (const LayerOption& option : layer_option_table())
    if (const double value = number_of(option, options); is_number(option) && !option.range.contains(value))
      return bad_option(std::string(option.name) + " is " + number_text(value) + "; give " +
                        std::string(option.values) + ".");
  if (!options.heights.empty()) return check_heights(options);
  if (options.growth != 0 && options.growth < 1)
    return bad_option(
        "The growth of the layers is below 1. It is the height of each layer over the height of the one below; give "
        "1 to 10.");
  const int given = (options.layers != 0 ? 1 : 0) + (options.first != 0 ? 1 : 0) + (options.growth != 0 ? 1 : 0);
  if (given < 2)
    return bad_option(
        "The heights of the layers are not known. Give two of the number of layers, the first height and the growth, "
        "or a list of heights.");
  return {};
}

}  // namespace varimesh
