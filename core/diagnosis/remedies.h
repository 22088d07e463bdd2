// What is left of a mesh that is not valid everywhere, and what its owner can try next.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/diagnosis/diagnosis.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh {

/// Something to try about elements that are not certified valid. It names no flag and no argument: the command, Python,
/// the page and the contract each have a table of what to do for a kind, in their own words (docs/repair.md, "What to
/// try next"). They say that and then the reason.
struct Remedy {
  enum class Kind : std::uint8_t {
    Optimise,       ///< Optimise the mesh, which was only judged.
    MoreTime,       ///< Give the run more time or more iterations: a limit or the caller ended it.
    UntilValid,     ///< Optimise with Until::Valid.
    RaiseOrder,     ///< Optimise with Options::order = `order`.
    Split,          ///< Optimise with Repair::Split.
    Slide,          ///< Let boundary nodes slide, on a CAD model or on the boundary as it came.
    OtherBoundary,  ///< Mesh the boundary anew, or refine it.
  };
  Kind kind = Kind::Optimise;
  std::int64_t elements = 0;  ///< How many elements it could help.
  std::string reason;         ///< Why it could help, and which elements: a clause in lower case with a full stop.
  int order = 0;              ///< With Kind::RaiseOrder; otherwise 0.
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
  bool movement = false;     ///< The mesh was optimised,
  bool until_valid = false;  ///< with Until::Valid,
  bool split = false;        ///< with Repair::Split.
  bool cut_short = false;    ///< A limit or the caller ended the optimisation.
  int next_order = 0;        ///< The order above that of the mesh.
  /// How many elements are left by an optimisation that first raises the mesh to `next_order`, if these are fewer.
  std::optional<std::int64_t> left_at_next_order{};
};

/// Counts the elements with these numbers, which are not certified valid, and says what to try next. `groups` come from
/// with_any_of(). A remedy is named only if it could help at least one element, and the likeliest comes first.
WhatIsLeft what_is_left(const HighOrderMesh& mesh, const std::vector<std::int64_t>& uncertified,
                        const std::vector<UnrepairableGroup>& groups, const Tried& tried);

}  // namespace varimesh
