// Sorts the uncertified elements by what could help them.
#include "core/diagnosis/remedies.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "core/base/counted.h"
#include "core/diagnosis/elements_text.h"
#include "core/mesh/check.h"
#include "core/mesh/connectivity.h"

namespace varimesh {
namespace {

/// What the diagnosis says about an element.
struct Findings {
  bool in_group = false, proved = false, folded = false;
};

using Numbers = std::vector<std::int64_t>;

std::string count_text(std::int64_t count) { return counted(count, "element"); }

/// The elements by what could help them.
struct Sorted {
  Numbers movable;     ///< In no group: movement may repair them.
  Numbers splittable;  ///< Tetrahedra that a split may help.
  Numbers boundary;    ///< Only another boundary helps.
};

Sorted sort_by_remedy(const HighOrderMesh& mesh, const std::unordered_map<std::int64_t, Findings>& found,
                      const Tried& tried) {
  Sorted sorted;
  const Cells cells(mesh, mesh.dimension);
  const bool nodes_stay = is_surface(mesh);
  for (std::size_t c = 0; c < cells.count(); ++c) {
    const auto at = found.find(cells.number(c));
    if (at == found.end()) continue;
    const auto& [in_group, proved, folded] = at->second;
    const bool may_split = cells.shape(c) == Shape::Tetrahedron && !folded && !tried.split;
    const bool may_move = !nodes_stay && !in_group && (!tried.movement || tried.cut_short || !tried.until_valid);
    if (may_move) sorted.movable.push_back(at->first);
    if (may_split && (in_group || tried.movement)) sorted.splittable.push_back(at->first);
    if (!may_move && !may_split) sorted.boundary.push_back(at->first);
  }
  return sorted;
}

Remedy movement_remedy(std::int64_t count, const Tried& tried) {
  if (!tried.movement) return {Remedy::Kind::Optimise, count, "moving nodes may repair " + count_text(count) + "."};
  if (tried.cut_short)
    return {Remedy::Kind::MoreTime, count, "moving nodes may still repair " + count_text(count) + "."};
  return {Remedy::Kind::UntilValid, count,
          "the run then untangles before it smooths, which may help " + count_text(count) + "."};
}

/// Boundary nodes of a mesh of volume elements can slide. Whether they have is not known here.
bool can_slide(const HighOrderMesh& mesh) { return mesh.dimension == 3; }

/// Raising the order, which has been seen to help.
Remedy order_remedy(std::int64_t uncertified, const Tried& tried) {
  const std::int64_t left = *tried.left_at_next_order;
  return {Remedy::Kind::RaiseOrder, uncertified - left,
          std::string("a run at this order has left ") + (left == 0 ? "no element" : "only " + count_text(left)) +
              " that is not certified valid.",
          tried.next_order};
}

/// Another boundary, for these elements.
Remedy boundary_remedy(const HighOrderMesh& mesh, const Numbers& numbers, const Tried& tried) {
  const std::string elements = elements_text(numbers, "element", "elements");
  return {Remedy::Kind::OtherBoundary, static_cast<std::int64_t>(numbers.size()),
          can_slide(mesh)
              ? "if sliding does not help " + elements + ", nothing else is known that does."
              : "nothing else is known to help " + elements + (tried.left_at_next_order ? " at this order." : ".")};
}

std::vector<Remedy> remedies_of(const HighOrderMesh& mesh, const Sorted& sorted, const Tried& tried) {
  std::vector<Remedy> remedies;
  if (const auto count = static_cast<std::int64_t>(sorted.movable.size()); count > 0)
    remedies.push_back(movement_remedy(count, tried));
  if (const auto count = static_cast<std::int64_t>(sorted.splittable.size()); count > 0)
    remedies.push_back(
        {Remedy::Kind::Split, count, "tetrahedra are split to make room, which may help " + count_text(count) + "."});
  if (const auto count = static_cast<std::int64_t>(sorted.boundary.size()); count > 0) {
    if (can_slide(mesh))
      remedies.push_back(
          {Remedy::Kind::Slide, count, "if they have not slid yet, this may help " + count_text(count) + "."});
    remedies.push_back(boundary_remedy(mesh, sorted.boundary, tried));
  }
  return remedies;
}

std::string sentence_of(const WhatIsLeft& left) {
  if (left.uncertified == 0) return "";
  const std::string none =
      count_text(left.uncertified) + (left.uncertified == 1 ? " is" : " are") + " not certified valid";
  if (left.proved == left.uncertified)
    return none + ", and it is proved that moving interior nodes cannot repair " + (left.proved == 1 ? "it." : "them.");
  std::string text = none + ".";
  if (left.proved > 0)
    text += " It is proved that moving nodes cannot repair " + std::to_string(left.proved) + " of these.";
  if (left.unproved > 0)
    text += " Moving nodes can probably not repair " + std::to_string(left.unproved) +
            (left.proved > 0 ? " more" : " of these") + ", but that is not proved.";
  return text;
}

}  // namespace

WhatIsLeft what_is_left(const HighOrderMesh& mesh, const Numbers& uncertified,
                        const std::vector<UnrepairableGroup>& groups, const Tried& tried) {
  std::unordered_map<std::int64_t, Findings> found;
  for (const std::int64_t number : uncertified) found.try_emplace(number);
  for (const UnrepairableGroup& group : groups)
    for (const std::int64_t number : group.elements)
      if (const auto at = found.find(number); at != found.end()) {
        at->second.in_group = true;
        at->second.folded |= group.kind == UnrepairableGroup::Kind::FoldedFace;
        at->second.proved |= is_proved(group) && group.elements.size() == 1;
      }
  WhatIsLeft left;
  left.uncertified = static_cast<std::int64_t>(found.size());
  for (const auto& [number, findings] : found)
    if (findings.in_group) ++(findings.proved ? left.proved : left.unproved);
  left.remedies = remedies_of(mesh, sort_by_remedy(mesh, found, tried), tried);
  if (tried.left_at_next_order) left.remedies.insert(left.remedies.begin(), order_remedy(left.uncertified, tried));
  left.sentence = sentence_of(left);
  return left;
}

}  // namespace varimesh
