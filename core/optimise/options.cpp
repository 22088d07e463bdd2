#include "core/optimise/options.h"

#include <cmath>
#include <string>

#include "core/reference/shape.h"

namespace varimesh {
namespace {

bool positive_or_zero(double value) { return std::isfinite(value) && value >= 0; }

}  // namespace

Expected<void> check(const Options& options) {
  const std::pair<const char*, double> constants[] = {
      {"mu", options.mu}, {"lambda", options.lambda}, {"kappa", options.kappa}};
  for (const auto& [name, value] : constants)
    if (!positive_or_zero(value))
      return bad_option("The constant " + std::string(name) + " is " + std::to_string(value) +
                        "; give a positive number, or 0 for the one of the set of constants.");
  if (!std::isfinite(options.tolerance) || options.tolerance <= 0)
    return bad_option(
        "The tolerance must be positive: it is the residual at which to stop, relative to the diagonal of "
        "the bounding box, such as 1e-6.");
  if (!std::isfinite(options.p_norm) || options.p_norm < 1 || options.p_norm > 16)
    return bad_option("p_norm is " + std::to_string(options.p_norm) + "; give 1 (the energy itself) to 16.");
  if (options.order < 0 || options.order > kMaxOrder)
    return bad_option("order is " + std::to_string(options.order) + "; give 1 to " + std::to_string(kMaxOrder) +
                      ", or 0 for the mesh's own.");
  if (options.max_iterations < 0)
    return bad_option("max_iterations is " + std::to_string(options.max_iterations) +
                      "; give 0 (checks and reports only) or more.");
  if (!std::isfinite(options.until_js) || options.until_js < 0 || options.until_js >= 1)
    return bad_option("until_js is " + std::to_string(options.until_js) +
                      "; give a scaled Jacobian below 1, or 0 not to stop at one.");
  if (!positive_or_zero(options.time_limit))
    return bad_option("time_limit is " + std::to_string(options.time_limit) + "; give seconds, or 0 for none.");
  if (options.threads < 0 || options.threads > 4096)
    return bad_option("threads is " + std::to_string(options.threads) +
                      "; give 1 to 4096, or 0 for all of the machine's.");
  if (options.quadrature_degree < 0 || options.quadrature_degree > 6 * kMaxOrder)
    return bad_option("quadrature_degree is " + std::to_string(options.quadrature_degree) + "; give up to " +
                      std::to_string(6 * kMaxOrder) + ", or 0 for twice the order.");
  if (!std::isfinite(options.region_below) || options.region_below < 0 || options.region_below > 1)
    return bad_option("region_below is " + std::to_string(options.region_below) +
                      "; give a scaled Jacobian up to 1, or 0 to let every free node move.");
  if (options.rings < 0)
    return bad_option("rings is " + std::to_string(options.rings) +
                      "; give 0 (only the cells below region_below) or more.");
  const bool takes_field = options.target == Target::Size || options.target == Target::Strain;
  if (takes_field && options.target_field.values.empty())
    return bad_option("The target needs a field and target_field is empty: give a size or strain a cell or vertex.");
  if (!takes_field && !options.target_field.values.empty())
    return bad_option("target_field is given and the target takes none: choose the target size or strain.");
  if (options.objective == Objective::Worst && options.until_js > 0)
    return bad_option(
        "objective is worst and until_js is given: worst raises the lowest scaled Jacobian as far as it goes; leave "
        "until_js at 0, or objective at energy.");
  if (options.repair == Repair::Split && takes_field)
    return bad_option(
        "repair is split and the target is a field: split elements would have no values in it; choose another target, "
        "or split first and optimise with the field then.");
  if (options.repair == Repair::Split && options.region_below > 0)
    return bad_option(
        "repair is split and region_below is given: what is split has to move wherever it is; leave region_below at "
        "0.");
  return {};
}

}  // namespace varimesh
