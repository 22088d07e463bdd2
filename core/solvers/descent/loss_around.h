// The loss of the cells around each cell.
#pragma once

#include <span>
#include <vector>

#include "core/problem/problem.h"

namespace varimesh {

/// By CellSet::first + cell: the largest of kFade^n times the value of a cell n steps away, where a step leads to a
/// cell that shares a vertex. After kMostSteps of them it falls no further, so it is positive if one value is. It does
/// not depend on the order of the cells.
std::vector<double> loss_around(const Problem& problem, std::span<const double> values);

}  // namespace varimesh
