#include "core/options/options.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "core/options/option_table.h"

namespace varimesh {
namespace {

/// An option that has an effect only with some energies.
struct OfSomeEnergies {
  std::string_view option;
  bool (*is_used)(const Options& options);
  std::string_view user;  ///< What uses it, as in "only … uses it".
};

bool is_linear(const Options& options) { return options.energy == Energy::LinearElastic; }
bool has_trace(const Options& options) { return is_linear(options) && options.volumetric == Volumetric::Trace; }
bool has_log(const Options& options) { return is_linear(options) && options.volumetric == Volumetric::Log; }
bool is_hyperelastic(const Options& options) { return options.energy == Energy::Hyperelastic; }

constexpr OfSomeEnergies kOfSomeEnergies[] = {
    {"strain", is_linear, "the energy linear-elastic"},
    {"volumetric", is_linear, "the energy linear-elastic"},
    {"winslow", [](const Options& options) { return options.energy == Energy::Winslow; }, "the energy winslow"},
    {"mu", [](const Options& options) { return is_hyperelastic(options) || is_linear(options); },
     "the energy hyperelastic or linear-elastic"},
    {"lambda", [](const Options& options) { return is_hyperelastic(options) || has_trace(options); },
     "the energy hyperelastic, or linear-elastic with the volumetric part trace,"},
    {"kappa", has_log, "the energy linear-elastic with the volumetric part log"},
};

/// Refuses an option that would change nothing.
Expected<void> check_effect(const Options& options) {
  for (const OfSomeEnergies& one : kOfSomeEnergies) {
    const auto found = std::ranges::find(option_table(), one.option, &OptionInfo::name);
    if (!is_default(*found, options) && !one.is_used(options))
      return bad_option(std::string(one.option) + " is given, but only " + std::string(one.user) +
                        " uses it; choose that, or leave out " + std::string(one.option) + ".");
  }
  if (options.region_below == 0 && options.rings != Options().rings)
    return bad_option(
        "rings is given, but it counts layers around the elements below region_below, and no region_below is given; "
        "give it, or leave out rings.");
  return {};
}

std::string word_of_repair(const Options& options) {
  const auto row = std::ranges::find(option_table(), "repair", &OptionInfo::name);
  const auto& member = std::get<ChoiceMember>(row->member);
  return std::string(member.words[static_cast<std::size_t>(member.get(options))]);
}

}  // namespace

Expected<void> check(const Options& options) {
  for (const OptionInfo& option : option_table())
    if (const double value = number_of(option, options); is_number(option) && !option.range.contains(value))
      return bad_option(std::string(option.name) + " is " + number_text(value) + "; give " +
                        std::string(option.values) + ".");
  if (auto effect = check_effect(options); !effect) return effect;
  const std::string word = word_of_repair(options);
  const bool takes_field = options.target == Target::Size || options.target == Target::Strain;
  if (takes_field && options.target_field.values.empty())
    return bad_option(
        "The target needs a field, and target_field is empty; give a size or strain per element or vertex.");
  if (!takes_field && !options.target_field.values.empty())
    return bad_option("target_field is given, but the target takes no field; choose the target size or strain.");
  if (options.objective == Objective::Worst && options.until_js > 0)
    return bad_option(
        "objective is worst and until_js is given, but worst raises the lowest scaled Jacobian as far as it can; "
        "leave until_js at 0, or objective at energy.");
  if (options.objective == Objective::Accuracy && options.until_js > 0)
    return bad_option(
        "objective is accuracy and until_js is given, but until_js ends a run before the loss of accuracy is lowered; "
        "give min_js, the scaled Jacobian that every element is to have, and leave until_js at 0.");
  constexpr int kCurved = 2;  // an order at which Objective::Auto depends on the options only
  if (objective_of(options, kCurved) != Objective::Accuracy && options.min_js != Options().min_js)
    return bad_option(
        "min_js is given, but only the objective accuracy looks at it, and the other options ask for the optimum of an "
        "energy; give until_js, or leave out the objective and the options of the energy.");
  if (objective_of(options, kCurved) != Objective::Accuracy && options.layer_spacing != LayerSpacing::Keep)
    return bad_option(
        "layer_spacing is given, but only the objective accuracy knows layers, and the other options ask for another "
        "objective; leave out the objective and the options of the energy, or layer_spacing.");
  if (splits(options.repair) && options.layer_spacing != LayerSpacing::Keep)
    return bad_option("repair is " + word +
                      " and layer_spacing is given, but splits do not know layers; leave layer_spacing at keep.");
  if (splits(options.repair) && takes_field)
    return bad_option("repair is " + word +
                      " and the target is a field, but split elements would have no values in the field; choose "
                      "another target, or split first and then optimise with the field.");
  if (splits(options.repair) && options.region_below > 0)
    return bad_option("repair is " + word +
                      " and region_below is given, but split elements must be able to move wherever they are; leave "
                      "region_below at 0.");
  return {};
}

Objective objective_of(const Options& options, int order) {
  if (options.objective != Objective::Auto) return options.objective;
  const bool names_energy = std::ranges::any_of(
      option_table(), [&](const OptionInfo& option) { return is_of_energy(option) && !is_default(option, options); });
  return names_energy || order == 1 ? Objective::Energy : Objective::Accuracy;
}

}  // namespace varimesh
