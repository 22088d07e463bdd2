// Sums over the cells of all sets of a problem, by several ranks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/ranks/halo.h"
#include "core/ranks/whole_reduction.h"
#include "core/terms/part/problem_part.h"

namespace varimesh {

/// Σ over the cells of a problem, numbered through over its sets (CellSet::first + cell). A Reduction adds up blocks of
/// such numbers, and a block may lie across the end of a set, so several ranks may have cells of it. The rank of its
/// first cell gets the values of the others.
class CellSum {
 public:
  explicit CellSum(const ProblemPart& part);

  /// The bits of Reduction::sum() over the values of the whole problem. All ranks call it together, inside team.run().
  /// @param values  by CellSet::first + cell of the part
  double sum(std::span<const double> values, const WholeReduction& reduction, std::size_t grain);

 private:
  std::vector<std::int32_t> terms_;  ///< By term of the rank's blocks: its place in numbers_.
  std::vector<double> numbers_;      ///< Of the rank's own cells, and then of those that come.
  Halo halo_;                        ///< By place in numbers_.
};

}  // namespace varimesh
