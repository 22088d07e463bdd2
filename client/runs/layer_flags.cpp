#include "client/runs/layer_flags.h"

#include <fmt/format.h>

#include <cmath>

#include "client/cli/option_flags.h"
#include "client/local/local.h"

namespace varimesh::client {
namespace {

constexpr const char* kGroup = "Layers";

/// The height at which y⁺ has this value in the turbulent layer on a flat plate, with the skin friction
/// C_f = 0.026 Re^(−1/7) (F. M. White, Viscous Fluid Flow).
/// @param length  the distance from the beginning of the plate, to which the Reynolds number belongs
double height_at(double y_plus, double reynolds, double length) {
  const double friction = 0.026 * std::pow(reynolds, -1.0 / 7);
  return y_plus * length / (reynolds * std::sqrt(friction / 2));
}

}  // namespace

void add_layer_flags(Command command, LayerFlags* flags, bool has_spacing) {
  add_layer_options(command, &flags->layers, has_spacing);
  command.add("--reynolds", &flags->reynolds, "Instead of --first: the Reynolds number of --length, on a flat plate")
      .positive()
      .excludes("--first")
      .value("RE")
      .group(kGroup);
  command.add("--length", &flags->length, "The distance from the beginning of the plate, in the mesh's unit")
      .positive()
      .needs("--reynolds")
      .value("L")
      .group(kGroup);
  command["--reynolds"].needs("--length");
  command.add("--y-plus", &flags->y_plus, "The y+ of the first layer with --reynolds; default: 1")
      .positive()
      .needs("--reynolds")
      .group(kGroup);
  for (const char* flag :
       {"--layers", "--first", "--growth", "--heights", "--rows", "--grow", "--simplices", "--reynolds"})
    command[flag].needs("--wall");
}

std::optional<v1::Layers> layers_of(const LayerFlags& flags, std::string* sentence) {
  if (flags.layers.walls_size() == 0) return std::nullopt;
  v1::Layers layers = flags.layers;
  if (flags.reynolds > 0) {
    layers.set_first(height_at(flags.y_plus, flags.reynolds, flags.length));
    *sentence = fmt::format("The first layer is {:g} high, where y+ is {:g}", layers.first(), flags.y_plus);
  }
  return layers;
}

Expected<std::optional<v1::Layers>> layers_of(const LayerFlags& flags, v1::Options* options, std::string* sentence) {
  auto layers = layers_of(flags, sentence);
  if (!layers) return layers;
  layers->set_spacing(options->layer_spacing());
  options->clear_layer_spacing();
  const auto checked = layer_options(*layers).and_then([](const LayerOptions& wanted) { return check(wanted); });
  if (!checked) return tl::unexpected(checked.error());
  return layers;
}

}  // namespace varimesh::client
