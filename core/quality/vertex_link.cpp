// Joins link triangles over sides with a free end, finds each piece's fence, and compares solid angles.
#include "core/quality/vertex_link.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>
#include <utility>

namespace varimesh::detail {
namespace {

constexpr double kPi = std::numbers::pi;
/// Radians, and determinants of unit vectors: far above the rounding of tangents, far below what a mesh could use.
constexpr double kTolerance = 1e-9;
/// A smallest room worth speaking of when solid angles are summed over a whole vertex.
constexpr double kSumTolerance = 1e-6;

using Side = std::pair<std::int32_t, std::int32_t>;

std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

/// Sides of all corners in the sense of their own corner, sorted, and the corner that each belongs to.
class Sides {
 public:
  explicit Sides(std::span<const LinkCorner> corners) {
    for (std::size_t k = 0; k < corners.size(); ++k)
      for (int i = 0; i < corners[k].size(); ++i)
        sides_.push_back({{corners[k].direction[at(i)], corners[k].direction[at((i + 1) % corners[k].size())]},
                          static_cast<std::int32_t>(k)});
    std::ranges::sort(sides_);
  }
  /// The corner on the other side; −1 on the boundary.
  std::int32_t across(const Side& side) const {
    const Side other(side.second, side.first);
    const auto found = std::ranges::lower_bound(sides_, other, {}, &Entry::first);
    return found == sides_.end() || found->first != other ? -1 : found->second;
  }
  auto begin() const { return sides_.begin(); }
  auto end() const { return sides_.end(); }

 private:
  using Entry = std::pair<Side, std::int32_t>;
  std::vector<Entry> sides_;
};

/// Which piece each corner is in, named by its first corner.
std::vector<std::int32_t> pieces(std::span<const LinkDirection> directions, std::size_t corners, const Sides& sides) {
  std::vector<std::int32_t> parent(corners);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](std::int32_t k) {
    while (parent[at(k)] != k) k = parent[at(k)] = parent[at(parent[at(k)])];
    return k;
  };
  for (const auto& [side, corner] : sides) {
    const std::int32_t other = sides.across(side);
    if (other < 0 || (directions[at(side.first)].fixed && directions[at(side.second)].fixed)) continue;
    const std::int32_t a = root(corner), b = root(other);
    parent[at(std::max(a, b))] = std::min(a, b);
  }
  for (std::size_t k = 0; k < corners; ++k) parent[k] = root(static_cast<std::int32_t>(k));
  return parent;
}

/// The loop that these directed sides make, if they make a single one.
std::optional<std::vector<std::int32_t>> single_loop(const std::vector<Side>& sides) {
  std::map<std::int32_t, std::int32_t> next;
  for (const Side& side : sides)
    if (!next.insert(side).second) return std::nullopt;
  if (next.empty()) return std::nullopt;
  std::vector<std::int32_t> loop{sides.front().first};
  while (loop.size() <= sides.size()) {
    const auto found = next.find(loop.back());
    if (found == next.end()) return std::nullopt;
    if (found->second == loop.front()) break;
    loop.push_back(found->second);
  }
  return loop.size() == sides.size() ? std::optional(loop) : std::nullopt;
}

/// The angle inside, at b, of a polygon that goes a → b → c with its inside to the left; in [0, 2π).
double inner_angle(const Vector& a, const Vector& b, const Vector& c) {
  const Vector to_c = cross(b, c), to_a = cross(b, a);  // both turned by a quarter about b
  const double angle = std::atan2(determinant(b, to_c, to_a), dot(to_c, to_a));
  return angle < 0 ? angle + 2 * kPi : angle;
}

/// Solid angle that the boundary leaves at the vertex; nothing where the boundary there is not one simple loop, or has
/// a cusp that may be closed or open by a whole turn.
std::optional<double> room(std::span<const LinkDirection> directions, const Sides& sides) {
  std::vector<Side> boundary;
  for (const auto& [side, corner] : sides)
    if (sides.across(side) < 0) boundary.push_back(side);
  if (boundary.empty()) return 4 * kPi;
  const auto loop = single_loop(boundary);
  if (!loop || loop->size() < 3) return std::nullopt;
  const std::size_t n = loop->size();
  double sum = -(static_cast<double>(n) - 2) * kPi;
  for (std::size_t i = 0; i < n; ++i) {
    const double angle = inner_angle(directions[at((*loop)[(i + n - 1) % n])].unit, directions[at((*loop)[i])].unit,
                                     directions[at((*loop)[(i + 1) % n])].unit);
    if (angle < kSumTolerance || angle > 2 * kPi - kSumTolerance) return std::nullopt;
    sum += angle;
  }
  return sum;
}

/// The fence of the piece: sides with both ends fixed, less those that the piece has on both sides (slits).
std::vector<Side> fence(std::int32_t piece, const std::vector<std::int32_t>& piece_of,
                        std::span<const LinkDirection> directions, const Sides& sides) {
  std::vector<Side> result;
  for (const auto& [side, corner] : sides) {
    if (piece_of[at(corner)] != piece) continue;
    if (!directions[at(side.first)].fixed || !directions[at(side.second)].fixed) continue;
    const std::int32_t other = sides.across(side);
    if (other >= 0 && piece_of[at(other)] == piece) continue;
    result.push_back(side);
  }
  return result;
}

/// A piece with a fence of three, as if it were at fault.
std::optional<LinkFault> fenced_by_three(std::int32_t piece, const std::vector<std::int32_t>& piece_of,
                                         std::span<const LinkDirection> directions, const Sides& sides) {
  const std::vector<Side> around = fence(piece, piece_of, directions, sides);
  if (around.size() != 3) return std::nullopt;
  const auto loop = single_loop(around);
  if (!loop) return std::nullopt;
  const Vector& b = directions[at((*loop)[0])].unit;
  const Vector& c = directions[at((*loop)[1])].unit;
  const Vector& d = directions[at((*loop)[2])].unit;
  LinkFault result;
  result.determinant = determinant(b, c, d);
  result.angle = solid_angle(b, c, d);
  for (std::size_t k = 0; k < piece_of.size(); ++k)
    if (piece_of[k] == piece) result.corners.push_back(static_cast<std::int32_t>(k));
  return result;
}

}  // namespace

double solid_angle(const Vector& b, const Vector& c, const Vector& d) {
  const double half = std::atan2(determinant(b, c, d), 1 + dot(b, c) + dot(c, d) + dot(d, b));
  return half < 0 ? 2 * half + 4 * kPi : 2 * half;
}

std::vector<LinkFault> link_faults(std::span<const LinkDirection> directions, std::span<const LinkCorner> corners) {
  const Sides sides(corners);
  const std::vector<std::int32_t> piece_of = pieces(directions, corners.size(), sides);
  std::vector<LinkFault> faults, fitting;
  double claimed = 0;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    if (piece_of[k] != static_cast<std::int32_t>(k)) continue;
    auto piece = fenced_by_three(piece_of[k], piece_of, directions, sides);
    if (!piece) continue;
    // One cell alone fills its triangle the plain way or not at all; several may go round the far side.
    const bool flat = std::abs(piece->determinant) <= kTolerance &&
                      (piece->angle <= kPi || piece->angle >= 3 * kPi || piece->corners.size() == 1);
    if (flat || (piece->corners.size() == 1 && piece->determinant < 0)) {
      faults.push_back(*piece);
      continue;
    }
    claimed += piece->angle;
    fitting.push_back(std::move(*piece));
  }
  const auto available = fitting.empty() ? std::nullopt : room(directions, sides);
  if (available) {
    std::ranges::stable_sort(fitting, std::ranges::greater{}, &LinkFault::angle);
    for (LinkFault& piece : fitting) {
      if (claimed <= *available + kSumTolerance) break;
      claimed -= piece.angle;
      piece.room = *available;
      faults.push_back(std::move(piece));
    }
  }
  return faults;
}

}  // namespace varimesh::detail
