// What is left of a mesh that is not valid everywhere, and what its owner can try next.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/diagnosis/diagnosis.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Something to try about elements that are not certified valid.
struct Remedy {
  std::string flags;          ///< Of `varimesh optimise`, for example "--repair split"; empty if no flag helps.
  std::int64_t elements = 0;  ///< How many elements it could help.
  std::string sentence;       ///< For humans.
};

/// The elements that are not certified valid, in figures. An element of an unrepairable group that is certified counts
/// nowhere.
struct WhatIsLeft {
  std::int64_t uncertified = 0;
  std::int64_t proved = 0;    ///< Of these, proved to be beyond repair by movement of nodes.
  std::int64_t unproved = 0;  ///< Of these, in an unrepairable group, but without a proof about this element.
  std::vector<Remedy> remedies;
  std::string sentence;  ///< The figures in words; empty if nothing is left.
};

/// What has been done to the mesh.
struct Tried {
  bool movement = false;     ///< It was optimised,
  bool until_valid = false;  ///< with Until::Valid,
  bool split = false;        ///< with Repair::Split.
  bool cut_short = false;    ///< A limit or the caller ended that.
  int next_order = 0;        ///< The order above that of the mesh.
  /// How many elements an optimisation leaves that begins with raising the mesh to that order, if these are fewer.
  std::optional<std::int64_t> left_at_next_order{};
};

/// Counts the elements with these numbers, which are not certified valid, and says what to try next. `groups` are those
/// of with_any_of(). A remedy is named only if it could help at least one element, and the likeliest comes first.
WhatIsLeft what_is_left(const HighOrderMesh& mesh, const std::vector<std::int64_t>& uncertified,
                        const std::vector<UnrepairableGroup>& groups, const Tried& tried);

}  // namespace varimesh
