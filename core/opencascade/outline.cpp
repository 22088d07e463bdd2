#include "core/opencascade/outline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace varimesh::cad {
namespace {

constexpr std::size_t kMostRows = 256;

}  // namespace

Outline::Point Outline::joined(const Point& end) {
  for (End& other : ends_) {
    const double off = std::max(std::abs(other.at[0] - end[0]) / band_[0], std::abs(other.at[1] - end[1]) / band_[1]);
    if (off > 2) continue;
    farthest_ = std::max(farthest_, off);
    ++other.lines;
    return other.at;
  }
  ends_.push_back({end, 1});
  return end;
}

void Outline::add(std::span<const Point> line) {
  if (line.size() < 2) return;
  Point from = joined(line.front());
  for (std::size_t k = 1; k < line.size(); ++k) {
    const Point to = k + 1 == line.size() ? joined(line[k]) : line[k];
    sides_.push_back({from, to});
    from = to;
  }
}

double Outline::row(double height) const {
  return std::floor((height - low_) / (high_ - low_) * static_cast<double>(row_start_.size() - 1));
}

bool Outline::finish() {
  make_rows();
  return !sides_.empty() && std::ranges::all_of(ends_, [](const End& end) { return end.lines % 2 == 0; });
}

void Outline::make_rows() {
  const double margin = reach() * band_[1];
  low_ = std::numeric_limits<double>::infinity();
  high_ = -low_;
  for (const Side& side : sides_) {
    low_ = std::min({low_, side.from[1] - margin, side.to[1] - margin});
    high_ = std::max({high_, side.from[1] + margin, side.to[1] + margin});
  }
  const std::size_t rows = std::clamp<std::size_t>(sides_.size(), 1, kMostRows);
  row_start_.assign(rows + 1, 0);
  const auto for_rows = [&](const Side& side, const auto& visit) {
    const auto [low, high] = std::minmax(side.from[1], side.to[1]);
    const double last = static_cast<double>(rows - 1);
    const auto first_row = static_cast<std::size_t>(std::clamp(row(low - margin), 0.0, last));
    const auto last_row = static_cast<std::size_t>(std::clamp(row(high + margin), 0.0, last));
    for (std::size_t row = first_row; row <= last_row; ++row) visit(row);
  };
  for (const Side& side : sides_) for_rows(side, [&](std::size_t row) { ++row_start_[row + 1]; });
  std::partial_sum(row_start_.begin(), row_start_.end(), row_start_.begin());
  std::vector<std::uint32_t> next(row_start_.begin(), row_start_.end() - 1);
  in_row_.resize(row_start_.back());
  for (std::size_t k = 0; k < sides_.size(); ++k)
    for_rows(sides_[k], [&](std::size_t row) { in_row_[next[row]++] = static_cast<std::uint32_t>(k); });
}

bool Outline::is_near(const Side& side, const Point& at) const {
  const auto scaled = [&](const Point& point) {
    return Point{(point[0] - at[0]) / band_[0], (point[1] - at[1]) / band_[1]};
  };
  return distance_to_side({0, 0}, scaled(side.from), scaled(side.to)) <= reach();
}

std::optional<bool> Outline::contains(const Point& at) const {
  if (!(at[1] >= low_ && at[1] <= high_)) return false;
  const auto row_here = std::min(static_cast<std::size_t>(row(at[1])), row_start_.size() - 2);
  bool is_inside = false;
  for (std::uint32_t k = row_start_[row_here]; k < row_start_[row_here + 1]; ++k) {
    const Side& side = sides_[in_row_[k]];
    if (is_near(side, at)) return std::nullopt;
    if ((side.from[1] > at[1]) == (side.to[1] > at[1])) continue;
    const double part = (at[1] - side.from[1]) / (side.to[1] - side.from[1]);
    if (side.from[0] + part * (side.to[0] - side.from[0]) > at[0]) is_inside = !is_inside;
  }
  return is_inside;
}

double distance_to_side(const Outline::Point& point, const Outline::Point& from, const Outline::Point& to) {
  const Outline::Point along{to[0] - from[0], to[1] - from[1]}, off{point[0] - from[0], point[1] - from[1]};
  const double length = along[0] * along[0] + along[1] * along[1];
  const double part = length > 0 ? std::clamp((off[0] * along[0] + off[1] * along[1]) / length, 0.0, 1.0) : 0.0;
  const double u = off[0] - part * along[0], v = off[1] - part * along[1];
  return std::sqrt(u * u + v * v);
}

std::vector<Outline::Point> spread_points(int count) {
  std::vector<Outline::Point> points;
  for (int k = 0; k < count; ++k) {
    const double turns = 0.6180339887498949 * k;
    points.push_back({turns - std::floor(turns), (k + 0.5) / count});
  }
  return points;
}

}  // namespace varimesh::cad
