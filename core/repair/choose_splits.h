// Which of the candidates are split. Internal to the library.
#pragma once

#include <span>
#include <vector>

#include "core/repair/split_candidates.h"
#include "core/repair/split_rules.h"

namespace varimesh {

/// Splits that give every group one of its candidates, as far as the chosen candidates share no cell. The choice is
/// greedy: the next candidate is the one in the most unserved groups per cell that it adds.
std::vector<SplitPlace> choose_splits(std::span<const WeakGroup> groups, const SplitRules& rules);

}  // namespace varimesh
