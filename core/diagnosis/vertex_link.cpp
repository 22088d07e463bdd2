// Joins link triangles across sides with a free end, finds the fence of each piece, and compares solid angles.
#include "core/diagnosis/vertex_link.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <utility>

#include "core/base/index.h"
#include "core/diagnosis/disjoint_sets.h"

namespace varimesh::detail {
namespace {

constexpr double kPi = std::numbers::pi;
/// For angles in radians and determinants of unit vectors: far above the rounding of tangents, far below what a mesh
/// could use.
constexpr double kTolerance = 1e-9;
/// The same for solid angles that are summed over a whole vertex.
constexpr double kSumTolerance = 1e-6;

using Side = std::pair<std::int32_t, std::int32_t>;

/// The sides of all corners, sorted, each in the direction of its own corner, and the corner that it belongs to.
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

/// By corner: the piece that it is in. A piece is named by its first corner.
std::vector<std::int32_t> pieces(std::span<const LinkDirection> directions, std::size_t corners, const Sides& sides) {
  DisjointSets sets(corners);
  for (const auto& [side, corner] : sides) {
    const std::int32_t other = sides.across(side);
    if (other < 0 || (directions[at(side.first)].fixed && directions[at(side.second)].fixed)) continue;
    sets.join(corner, other);
  }
  std::vector<std::int32_t> piece_of;
  for (std::size_t k = 0; k < corners; ++k) piece_of.push_back(sets.find(static_cast<std::int32_t>(k)));
  return piece_of;
}

/// The loop that these directed sides form, if they form a single one.
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

/// The inner angle at b, in [0, 2π), of a polygon that goes a → b → c with its inside to the left.
double inner_angle(const Vector& a, const Vector& b, const Vector& c) {
  const Vector to_c = cross(b, c), to_a = cross(b, a);  // both turned about b by a quarter turn
  const double angle = std::atan2(determinant(b, to_c, to_a), dot(to_c, to_a));
  return angle < 0 ? angle + 2 * kPi : angle;
}

/// Solid angle to the left of a closed polygon of directions, in [0, 4π): the sum of its inner angles minus those of a
/// plane polygon. Nothing if it cannot be told whether a corner is closed or open by a whole turn. (A sum over
/// triangles would have sides between opposite directions.)
std::optional<double> polygon_angle(const std::vector<std::int32_t>& loop, std::span<const LinkDirection> directions) {
  const std::size_t n = loop.size();
  if (n < 3) return std::nullopt;
  double sum = -(static_cast<double>(n) - 2) * kPi;
  for (std::size_t i = 0; i < n; ++i) {
    const double angle = inner_angle(directions[at(loop[(i + n - 1) % n])].unit, directions[at(loop[i])].unit,
                                     directions[at(loop[(i + 1) % n])].unit);
    if (angle < kSumTolerance || angle > 2 * kPi - kSumTolerance) return std::nullopt;
    sum += angle;
  }
  sum = std::fmod(sum, 4 * kPi);
  return sum < 0 ? sum + 4 * kPi : sum;
}

/// Solid angle that the boundary leaves at the vertex. Nothing if the boundary there is not one simple loop, or if it
/// has a cusp that may be closed or open by a whole turn.
std::optional<double> room(std::span<const LinkDirection> directions, const Sides& sides) {
  std::vector<Side> boundary;
  for (const auto& [side, corner] : sides)
    if (sides.across(side) < 0) boundary.push_back(side);
  if (boundary.empty()) return 4 * kPi;
  const auto loop = single_loop(boundary);
  return loop ? polygon_angle(*loop, directions) : std::nullopt;
}

/// The fence of the piece: sides with both ends fixed, without those that have the piece on both sides (slits).
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

/// A piece with a single fence, described as if it were at fault; nothing for other pieces.
std::optional<LinkFault> fenced(std::int32_t piece, const std::vector<std::int32_t>& piece_of,
                                std::span<const LinkDirection> directions, const Sides& sides) {
  const std::vector<Side> around = fence(piece, piece_of, directions, sides);
  const auto loop = single_loop(around);
  if (!loop || loop->size() < 3) return std::nullopt;
  LinkFault result;
  result.fence = static_cast<int>(loop->size());
  result.determinant = 1;
  for (std::size_t i = 0; i < loop->size(); ++i)
    result.determinant =
        std::min(result.determinant,
                 determinant(directions[at((*loop)[i])].unit, directions[at((*loop)[(i + 1) % loop->size()])].unit,
                             directions[at((*loop)[(i + 2) % loop->size()])].unit));
  if (result.fence == 3) {
    result.angle =
        solid_angle(directions[at((*loop)[0])].unit, directions[at((*loop)[1])].unit, directions[at((*loop)[2])].unit);
  } else {
    const auto angle = polygon_angle(*loop, directions);
    if (!angle) return std::nullopt;
    result.angle = *angle;
  }
  for (std::size_t k = 0; k < piece_of.size(); ++k)
    if (piece_of[k] == piece) result.corners.push_back(static_cast<std::int32_t>(k));
  return result;
}

/// The largest value over unit vectors x of the smallest n · x, for unit vectors n.
double widest_margin(const std::vector<Vector>& normals) {
  double best = -1;
  for_each_widest_candidate(normals, plus, [&](Vector x) {
    if (normalise(x)) best = std::max(best, smallest_product(normals, x));
  });
  return best;
}

/// The corners that have this free direction and no other free one, if they are at fault. Their determinants are linear
/// in the free direction.
std::optional<LinkFault> fan(std::int32_t free, std::span<const LinkDirection> directions,
                             std::span<const LinkCorner> corners) {
  LinkFault result;
  result.free_direction = free;
  std::vector<Vector> normals;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    if (corners[k].size() != 3) continue;
    for (std::size_t i = 0; i < 3; ++i) {
      if (corners[k].direction[i] != free) continue;
      const LinkDirection& b = directions[at(corners[k].direction[(i + 1) % 3])];
      const LinkDirection& c = directions[at(corners[k].direction[(i + 2) % 3])];
      if (!b.fixed || !c.fixed) continue;
      Vector n = cross(b.unit, c.unit);
      const double length = std::sqrt(dot(n, n));
      for (double& component : n) component = length > kTolerance ? component / length : 0;
      normals.push_back(n);
      result.corners.push_back(static_cast<std::int32_t>(k));
    }
  }
  if (normals.empty()) return std::nullopt;
  result.determinant = widest_margin(normals);
  return result.determinant <= kTolerance ? std::optional(result) : std::nullopt;
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
    auto piece = fenced(piece_of[k], piece_of, directions, sides);
    if (!piece) continue;
    // A single cell fills its triangle the plain way or not at all; several cells may go around the far side.
    const bool flat = piece->fence == 3 && std::abs(piece->determinant) <= kTolerance &&
                      (piece->angle <= kPi || piece->angle >= 3 * kPi || piece->corners.size() == 1);
    claimed += piece->angle;
    if (flat || (piece->fence == 3 && piece->corners.size() == 1 && piece->determinant < 0)) {
      if (piece->angle > kPi) claimed -= 4 * kPi;
      faults.push_back(std::move(*piece));
    } else {
      fitting.push_back(std::move(*piece));
    }
  }
  // A piece that is not positive everywhere may count as turned inside out; then it claims a whole sphere less. At
  // fault are the pieces that need the least turning until the rest fits, and those that could be turned instead of the
  // last.
  std::ranges::stable_sort(fitting, std::ranges::greater{}, &LinkFault::angle);
  const auto available = fitting.empty() ? std::nullopt : room(directions, sides);
  double turned = 0;  // the angle of the last piece when turned inside out
  for (LinkFault& piece : fitting) {
    if (!available) break;
    const bool instead = piece.angle > *available + kSumTolerance && 4 * kPi - piece.angle <= 2 * turned;
    if (claimed <= *available + kSumTolerance && !instead) break;
    if (!instead) turned = 4 * kPi - piece.angle;
    claimed -= 4 * kPi;
    piece.room = *available;
    faults.push_back(std::move(piece));
  }
  const auto is_known = [&](const LinkFault& other) {
    return std::ranges::any_of(faults, [&](const LinkFault& fault) {
      return std::ranges::includes(fault.corners, other.corners);  // both are in ascending order
    });
  };
  for (std::size_t i = 0; i < directions.size(); ++i) {
    if (directions[i].fixed) continue;
    auto around = fan(static_cast<std::int32_t>(i), directions, corners);
    if (around && !is_known(*around)) faults.push_back(std::move(*around));
  }
  return faults;
}

}  // namespace varimesh::detail
