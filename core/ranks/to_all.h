// What the first rank has goes to all, and whether all have the same.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

#include "core/ranks/ranks.h"

namespace varimesh {

/// Replaces the bytes by those of the first rank. As many on each rank, and all call it. No rank needs memory for
/// another copy of them.
void broadcast(std::span<std::byte> bytes, const Ranks& ranks);

/// Whether all ranks have the same text, on all ranks. All call it.
bool have_same(std::string_view mine, const Ranks& ranks);

}  // namespace varimesh
