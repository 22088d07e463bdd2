#include "core/options/geometry_options.h"

#include <string>

#include "core/options/option_table.h"

namespace varimesh {

Expected<void> check(const GeometryOptions& options) {
  for (const GeometryOption& option : geometry_option_table())
    if (const double value = number_of(option, options); is_number(option) && !option.range.contains(value))
      return bad_option(std::string(option.name) + " is " + number_text(value) + "; give " +
                        std::string(option.values) + ".");
  if (options.on_boundary() && (!options.file.empty() || options.order > 0 || options.snap))
    return bad_option(
        "slide_on boundary cannot be combined with a model, snap or an order: nodes slide on the mesh's own boundary.");
  if (options.on_boundary() && options.slide == SlideOn::Coupled)
    return bad_option(
        "slide coupled needs a model; with slide_on boundary, slide may be 'none', 'surfaces', 'all' or 'auto'.");
  if (options.on_boundary() && options.smooth_angle > 0)
    return bad_option(
        "smooth_angle joins surfaces of a model, and slide_on boundary has no model; leave one of the two out.");
  if (options.tolerance > 0 && options.slide != SlideOn::Coupled)
    return bad_option("The tolerance of a geometry goes only with slide coupled.");
  return {};
}

}  // namespace varimesh
