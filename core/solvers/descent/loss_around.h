// The loss of the cells around each cell.
#pragma once

#include <span>
#include <vector>

#include "core/base/team.h"
#include "core/problem/problem.h"

namespace varimesh {

/// By CellSet::first + cell: the largest value of a cell of `values`, halved for each step on the way from there. A
/// step leads to a cell that shares a vertex. After 20 steps the value falls no further, so all results are positive if
/// one value is. They do not depend on the order of the cells or the number of threads. Call it inside team.run().
std::vector<double> loss_around(const Problem& problem, std::span<const double> values, const Team& team);

}  // namespace varimesh
