// Each chunk of points has a box of its own. The boxes are joined in the order of the chunks.
#include "core/mesh/bounding_box.h"

#include <algorithm>

#include "core/base/shared_work.h"

namespace varimesh {

namespace {

constexpr std::size_t kPointsPerTask = 16384;

template <class Point>
BoundingBox box_of(std::size_t count, const Team& team, const Point& point) {
  std::vector<BoundingBox> boxes(chunks_of(count, kPointsPerTask));
  for_chunks(team, count, kPointsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    BoundingBox box;
    for (std::size_t i = begin; i < end; ++i) box.extend(point(i));
    boxes[chunk] = box;
  });
  BoundingBox all;
  for (const BoundingBox& box : boxes) all.extend(box);
  return all;
}

}  // namespace

void BoundingBox::extend(const BoundingBox& other) {
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::min(low[k], other.low[k]);
    high[k] = std::max(high[k], other.high[k]);
  }
}

void BoundingBox::extend(const double* point) {
  for (std::size_t k = 0; k < 3; ++k) {
    low[k] = std::min(low[k], point[k]);
    high[k] = std::max(high[k], point[k]);
  }
}

BoundingBox bounding_box(const std::vector<double>& coordinates, const Team& team) {
  return box_of(coordinates.size() / 3, team, [&](std::size_t i) { return coordinates.data() + 3 * i; });
}

BoundingBox bounding_box(const std::vector<double>& coordinates, const std::vector<std::int32_t>& points,
                         const Team& team) {
  return box_of(points.size(), team,
                [&](std::size_t i) { return coordinates.data() + 3 * static_cast<std::size_t>(points[i]); });
}

}  // namespace varimesh
