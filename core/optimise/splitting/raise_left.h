// The last attempt at cells that splits have left invalid. Internal to core/optimise.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/stop_token.h"
#include "core/optimise/result.h"
#include "core/options/options.h"

namespace varimesh {

/// Raises the scaled Jacobian of these cells in small patches (core/maxmin/raise.h). Each cell that becomes certified
/// valid counts, whatever it costs the others in quality; none loses its certificate. Changes the coordinates, the
/// report and the notes of the result. The token may stop it.
/// @param numbers  of elements that are not certified valid, in ascending order
void raise_left(Result& result, std::span<const std::int64_t> numbers, const Options& options, StopToken& stop);

}  // namespace varimesh
