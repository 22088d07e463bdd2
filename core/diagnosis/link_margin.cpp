// Joins corners to pieces, and turns one free direction after another to where its own corners have most room.
#include "core/diagnosis/link_margin.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

constexpr int kRounds = 40;
constexpr double kSettled = 1e-4;  // of a margin from one round to the next

using Side = std::pair<std::int32_t, std::int32_t>;

Vector minus(const Vector& a, const Vector& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vector plus(const Vector& a, const Vector& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }

bool normalise(Vector& x) {
  const double length = std::sqrt(dot(x, x));
  if (!(length > 0)) return false;
  for (double& component : x) component /= length;
  return true;
}

double smallest(const std::vector<Vector>& normals, const Vector& x) {
  double result = 1;
  for (const Vector& n : normals) result = std::min(result, dot(n, x));
  return result;
}

/// The unit vector x with the largest smallest n · x. By duality it points to the place of the vectors' convex hull
/// that is nearest to the origin, and so is given by one, two or three of them.
Vector widest(const std::vector<Vector>& normals, const Vector& start) {
  Vector best = start;
  double value = smallest(normals, start);
  const auto attempt = [&](Vector x) {
    if (!normalise(x)) return;
    const double found = smallest(normals, x);
    if (found <= value) return;
    value = found;
    best = x;
  };
  for (std::size_t i = 0; i < normals.size(); ++i) {
    attempt(normals[i]);
    for (std::size_t j = 0; j < i; ++j) {
      // Where both give the same: on the plane across their difference, nearest to their sum.
      const Vector across = minus(normals[i], normals[j]), sum = plus(normals[i], normals[j]);
      const double square = dot(across, across);
      if (square > 0) {
        const double part = dot(sum, across) / square;
        attempt({sum[0] - part * across[0], sum[1] - part * across[1], sum[2] - part * across[2]});
      }
      for (std::size_t k = 0; k < j; ++k) {
        const Vector x = cross(minus(normals[j], normals[i]), minus(normals[k], normals[i]));
        attempt(x);
        attempt({-x[0], -x[1], -x[2]});
      }
    }
  }
  return best;
}

class Search {
 public:
  Search(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners, const LinkPiece& piece)
      : corners_(corners), piece_(piece) {
    for (const LinkDirection& direction : directions) units_.push_back(direction.unit);
    for (const std::int32_t k : piece.corners)
      for (std::size_t i = 0; i < 3; ++i)
        if (!directions[at(corners[at(k)].direction[i])].fixed) around_[corners[at(k)].direction[i]].push_back({k, i});
  }

  /// From the directions as they are.
  double run() {
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

  /// Puts each free direction between those round it.
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

  /// Whether the angles round a free direction add up to more than one turn.
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

double fence_of_three(std::span<const LinkDirection> directions, const LinkPiece& piece) {
  const Side first = piece.fence[0], second = piece.fence[1].first == first.second ? piece.fence[1] : piece.fence[2];
  return determinant(directions[at(first.first)].unit, directions[at(first.second)].unit,
                     directions[at(second.second)].unit);
}

double margin_of(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners, const LinkPiece& piece,
                 std::span<const LinkFault> faults, double enough) {
  const bool named = std::ranges::any_of(
      faults, [&](const LinkFault& fault) { return fault.fence > 0 && fault.corners == piece.corners; });
  if (piece.fence.size() == 3) {
    const double margin = fence_of_three(directions, piece);
    if (margin > 0 || named || piece.inside.empty()) return std::min(margin, named ? 0 : margin);
  }
  if (named) return -1;
  Search search(directions, corners, piece);
  const double margin = search.run();
  if (margin > enough) return margin;
  Search again(directions, corners, piece);
  again.spread();
  return std::max(margin, again.run());
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
  std::vector<std::int32_t> parent(corners.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t k) {
    while (parent[at(k)] != k) k = parent[at(k)] = parent[at(parent[at(k)])];
    return k;
  };
  for (const auto& [side, corner] : corner_of) {
    const std::int32_t other = behind(side);
    if (other < 0 || is_fixed(side)) continue;
    const std::int32_t a = root(corner), b = root(other);
    parent[at(std::max(a, b))] = std::min(a, b);
  }
  std::map<std::int32_t, LinkPiece> pieces;
  for (std::size_t k = 0; k < corners.size(); ++k)
    pieces[root(static_cast<std::int32_t>(k))].corners.push_back(static_cast<std::int32_t>(k));
  for (const auto& [side, corner] : corner_of) {
    LinkPiece& piece = pieces[root(corner)];
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
