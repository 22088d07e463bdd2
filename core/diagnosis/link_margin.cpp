// Joins corners to pieces, and turns one free direction after another to where its own corners have the most room.
#include "core/diagnosis/link_margin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "core/base/index.h"
#include "core/diagnosis/disjoint_sets.h"

namespace varimesh::detail {
namespace {

constexpr int kRounds = 40;
constexpr double kSettled = 1e-4;  // a gain of less than this in one round ends the search

using Side = std::pair<std::int32_t, std::int32_t>;

/// The unit vector x with the largest smallest n · x, or `start` if none is better.
Vector widest(const std::vector<Vector>& normals, const Vector& start) {
  Vector best = start;
  double value = smallest_product(normals, start);
  // Where two of them give the same: on the plane across their difference, nearest to their sum.
  const auto between = [](const Vector& a, const Vector& b) -> Vector {
    const Vector across = minus(a, b), sum = plus(a, b);
    const double square = dot(across, across);
    if (!(square > 0)) return {};
    const double part = dot(sum, across) / square;
    return {sum[0] - part * across[0], sum[1] - part * across[1], sum[2] - part * across[2]};
  };
  for_each_widest_candidate(normals, between, [&](Vector x) {
    if (!normalise(x)) return;
    const double found = smallest_product(normals, x);
    if (found <= value) return;
    value = found;
    best = x;
  });
  return best;
}

/// Turns the free directions of one piece.
class Search {
 public:
  Search(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners, const LinkPiece& piece)
      : corners_(corners), piece_(piece) {
    for (const LinkDirection& direction : directions) units_.push_back(direction.unit);
    for (const std::int32_t k : piece.corners)
      for (std::size_t i = 0; i < 3; ++i)
        if (!directions[at(corners[at(k)].direction[i])].fixed) around_[corners[at(k)].direction[i]].push_back({k, i});
  }

  /// Turns them from where they are; returns the largest margin found.
  double search() {
    double best = margin();
    for (int round = 0; round < kRounds; ++round) {
      for (const auto& [direction, places] : around_) {
        std::vector<Vector> normals;
        for (const auto& [corner, i] : places) normals.push_back(cross(unit(corner, i + 1), unit(corner, i + 2)));
        units_[at(direction)] = widest(normals, units_[at(direction)]);
      }
      const double now = margin();
      if (round > 3 && now < best + kSettled) break;
      best = std::max(best, now);
    }
    return best;
  }

  /// Puts each free direction between those around it.
  void spread() {
    for (int round = 0; round < 10; ++round)
      for (const auto& [direction, places] : around_) {
        Vector sum{};
        for (const auto& [corner, i] : places) sum = plus(sum, plus(unit(corner, i + 1), unit(corner, i + 2)));
        if (normalise(sum)) units_[at(direction)] = sum;
      }
  }

 private:
  const Vector& unit(std::int32_t corner, std::size_t i) const {
    return units_[at(corners_[at(corner)].direction[i % 3])];
  }

  double margin() const {
    double result = 1;
    for (const std::int32_t k : piece_.corners)
      result = std::min(result, determinant(unit(k, 0), unit(k, 1), unit(k, 2)));
    return result > 0 && wraps() ? -1 : result;
  }

  /// Whether the angles around a free direction add up to more than one turn.
  bool wraps() const {
    for (const auto& [direction, places] : around_) {
      double sum = 0;
      for (const auto& [corner, i] : places) {
        const Vector &x = unit(corner, i), &b = unit(corner, i + 1), &c = unit(corner, i + 2);
        const Vector to_b = cross(x, b), to_c = cross(x, c);
        sum += std::atan2(std::abs(determinant(x, to_b, to_c)), dot(to_b, to_c));
      }
      if (sum > 3 * std::numbers::pi) return true;
    }
    return false;
  }

  std::span<const LinkCorner> corners_;
  const LinkPiece& piece_;
  std::vector<Vector> units_;
  std::map<std::int32_t, std::vector<std::pair<std::int32_t, std::size_t>>> around_;
};

/// The determinant of the three directions of a fence.
double fence_of_three(std::span<const LinkDirection> directions, const LinkPiece& piece) {
  const Side first = piece.fence[0], second = piece.fence[1].first == first.second ? piece.fence[1] : piece.fence[2];
  return determinant(directions[at(first.first)].unit, directions[at(first.second)].unit,
                     directions[at(second.second)].unit);
}

double margin_of(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners, const LinkPiece& piece,
                 std::span<const LinkFault> faults, double enough) {
  const bool at_fault = std::ranges::any_of(
      faults, [&](const LinkFault& fault) { return fault.fence > 0 && fault.corners == piece.corners; });
  if (piece.fence.size() == 3) {
    const double margin = fence_of_three(directions, piece);
    if (margin > 0 || at_fault || piece.inside.empty()) return std::min(margin, at_fault ? 0 : margin);
  }
  if (at_fault) return -1;
  Search search(directions, corners, piece);
  const double margin = search.search();
  if (margin > enough) return margin;
  Search again(directions, corners, piece);
  again.spread();
  return std::max(margin, again.search());
}

}  // namespace

std::vector<LinkPiece> link_pieces(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners,
                                   double enough) {
  std::map<Side, std::int32_t> corner_of;
  for (std::size_t k = 0; k < corners.size(); ++k)
    for (std::size_t i = 0; i < 3; ++i)
      corner_of.emplace(Side{corners[k].direction[i], corners[k].direction[(i + 1) % 3]}, static_cast<std::int32_t>(k));
  const auto behind = [&](const Side& side) {
    const auto found = corner_of.find({side.second, side.first});
    return found == corner_of.end() ? -1 : found->second;
  };
  const auto is_fixed = [&](const Side& side) {
    return directions[at(side.first)].fixed && directions[at(side.second)].fixed;
  };
  DisjointSets sets(corners.size());
  for (const auto& [side, corner] : corner_of) {
    const std::int32_t other = behind(side);
    if (other >= 0 && !is_fixed(side)) sets.join(corner, other);
  }
  std::map<std::int32_t, LinkPiece> pieces;
  for (std::size_t k = 0; k < corners.size(); ++k)
    pieces[sets.find(static_cast<std::int32_t>(k))].corners.push_back(static_cast<std::int32_t>(k));
  for (const auto& [side, corner] : corner_of) {
    LinkPiece& piece = pieces[sets.find(corner)];
    if (is_fixed(side))
      piece.fence.push_back(side);
    else if (side.first < side.second || behind(side) < 0)
      piece.inside.push_back(side);
  }
  const std::vector<LinkFault> faults = link_faults(directions, corners);
  std::vector<LinkPiece> result;
  for (auto& [name, piece] : pieces) {
    piece.margin = margin_of(directions, corners, piece, faults, enough);
    result.push_back(std::move(piece));
  }
  return result;
}

}  // namespace varimesh::detail
