// The flags of layers into which thick cells at walls are split: those of the library's table, and a first height that
// follows from a Reynolds number.
#pragma once

#include <optional>
#include <string>

#include "client/cli/parser.h"
#include "core/base/error.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

struct LayerFlags {
  v1::Layers layers;
  double reynolds = 0, length = 0, y_plus = 1;
};

/// Adds a flag for each option of layers. Each needs --wall.
/// @param has_spacing  whether --layer-spacing is one of them; it is also an option of the optimisation
void add_layer_flags(Command command, LayerFlags* flags, bool has_spacing);

/// The layers that the flags ask for; nothing if there is no wall.
/// @param sentence  receives the height that follows from a Reynolds number, in a sentence
std::optional<v1::Layers> layers_of(const LayerFlags& flags, std::string* sentence);

/// The same beside the options of an optimisation: --layer-spacing then speaks of the new layers, and is taken out of
/// the options. Errors: BadOption if no mesh could have the layers.
Expected<std::optional<v1::Layers>> layers_of(const LayerFlags& flags, v1::Options* options, std::string* sentence);

}  // namespace varimesh::client
