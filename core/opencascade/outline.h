// The boundary of a face in its parameters, as polygons. Internal to the plugin.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace varimesh::cad {

/// Closed polygons: a point is inside if a ray from it crosses them an odd number of times. Each row of points is
/// compared only with the sides that pass through it. A point that is near to a side has no answer, because the
/// polygons are not exactly the boundary. Immutable after finish(), so threads may share it then.
class Outline {
 public:
  using Point = std::array<double, 2>;

  /// @param band  how near to a side a point has no answer, in each direction; positive and finite
  explicit Outline(const Point& band) : band_(band) {}

  /// Adds the sides between the points of an open or closed line. If one of its ends is within two bands of an end of
  /// an earlier line, it is moved there, so that lines that follow each other make a closed polygon.
  void add(std::span<const Point> line);
  /// Returns false if the lines do not make closed polygons. There are no answers then.
  bool finish();

  /// Whether the point is inside; nothing if it is near to a side.
  std::optional<bool> contains(const Point& at) const;

 private:
  struct Side {
    Point from, to;
  };
  struct End {
    Point at;
    int lines;  ///< That begin or end there; a closed line counts twice.
  };

  Point joined(const Point& end);
  /// How near to a side a point has no answer, in bands. An end that was moved may be off by √2 of farthest_.
  double reach() const { return 1 + 1.5 * farthest_; }
  bool is_near(const Side& side, const Point& at) const;
  /// The row at this height, from −∞ to ∞.
  double row(double height) const;
  void make_rows();

  Point band_;
  double farthest_ = 0;  ///< By how much ends were moved, in bands.
  std::vector<End> ends_;
  std::vector<Side> sides_;
  double low_ = 0, high_ = 0;             ///< Of all rows.
  std::vector<std::uint32_t> row_start_;  ///< By row: where its sides begin in in_row_.
  std::vector<std::uint32_t> in_row_;     ///< The sides that pass through each row or near to it.
};

/// The distance of a point to the straight line between two others, which ends there.
double distance_to_side(const Outline::Point& point, const Outline::Point& from, const Outline::Point& to);

/// Points of the unit square, spread evenly by the golden ratio.
std::vector<Outline::Point> spread_points(int count);

}  // namespace varimesh::cad
