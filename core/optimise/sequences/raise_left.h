// The last attempt at cells that splits have left invalid. Internal to core/optimise.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/stop_token.h"
#include "core/optimise/result.h"
#include "core/options/options.h"

namespace varimesh {

/// Raises the scaled Jacobian of these cells in small patches (core/solvers/maxmin/raise.h). No cell loses its
/// certificate. If one becomes certified valid, this changes the coordinates, the report and the notes of the result,
/// otherwise nothing. The token may stop it.
/// @param numbers  of elements that are not certified valid, in ascending order
void raise_left(Result& result, std::span<const std::int64_t> numbers, const Options& options, StopToken& stop);

}  // namespace varimesh
