// The options of an optimisation, of a geometry and of layers as flags, by the tables of the library
// (core/options/option_table.h).
#pragma once

#include <string>

#include "client/cli/parser.h"
#include "core/options/option_table.h"
#include "varimesh/v1/job.pb.h"

namespace varimesh::client {

/// The help of an option: the sentence of the table, and the default unless the sentence says what 0 means.
template <class Of>
std::string help_text(const OptionOf<Of>& option);

/// The flag of an option, such as "--max-iterations".
template <class Of>
std::string flag_of(const OptionOf<Of>& option);

/// Makes --order required, and lets it be only an order that a mesh is curved to. For after add_options().
void require_curved_order(Command command);

/// Adds a flag for each option of the table. A flag that is given sets its field in `options`; the others stay
/// unset.
void add_options(Command command, v1::Options* options);

/// The same for a geometry.
/// @param has_slide_on  whether the command does without a model, so that --slide-on has a meaning
void add_geometry_options(Command command, v1::Geometry* geometry, bool has_slide_on);

/// The same for layers.
/// @param has_spacing  whether --layer-spacing is one of them
void add_layer_options(Command command, v1::Layers* layers, bool has_spacing);

}  // namespace varimesh::client
