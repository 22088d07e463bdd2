#include "core/geometry/cad/model_triangles.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace varimesh::geometry {
namespace {

template <class T>
void put(std::string& bytes, const T* values, std::size_t count) {
  bytes.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

/// Takes values from the front of the bytes. False if there are too few.
template <class T>
bool take(std::string_view& bytes, T* values, std::size_t count) {
  const std::size_t size = count * sizeof(T);
  if (bytes.size() < size) return false;
  if (size > 0) std::memcpy(values, bytes.data(), size);
  bytes.remove_prefix(size);
  return true;
}

/// Before the values of each face.
struct Head {
  std::int32_t tag = 0, nodes = 0, triangles = 0;
};

/// Bounds for the faces that are still to come.
struct Left {
  std::int32_t tag = 0;  ///< Their tags are greater than this.
  std::int32_t triangles = kMostTriangles, nodes = 3 * kMostTriangles;
};

bool take_face(std::string_view& bytes, FaceTriangles& face, Left& left) {
  Head head;
  if (!take(bytes, &head, 1) || head.tag <= left.tag || head.nodes <= 0 || head.nodes > left.nodes ||
      head.triangles <= 0 || head.triangles > left.triangles)
    return false;
  left = {head.tag, left.triangles - head.triangles, left.nodes - head.nodes};
  const std::size_t coordinates = 3 * static_cast<std::size_t>(head.nodes);
  const std::size_t corners = 3 * static_cast<std::size_t>(head.triangles);
  if (bytes.size() < coordinates * sizeof(double) + corners * sizeof(std::int32_t)) return false;
  face.tag = head.tag;
  face.coordinates.resize(coordinates);
  face.corners.resize(corners);
  if (!take(bytes, face.coordinates.data(), coordinates) || !take(bytes, face.corners.data(), corners)) return false;
  return std::ranges::all_of(face.coordinates, [](double value) { return std::isfinite(value); }) &&
         std::ranges::all_of(face.corners, [&](std::int32_t node) { return node >= 0 && node < head.nodes; });
}

}  // namespace

std::string encode(const std::vector<FaceTriangles>& faces) {
  std::string bytes;
  for (const FaceTriangles& face : faces) {
    const Head head{face.tag, static_cast<std::int32_t>(face.coordinates.size() / 3),
                    static_cast<std::int32_t>(face.corners.size() / 3)};
    put(bytes, &head, 1);
    put(bytes, face.coordinates.data(), face.coordinates.size());
    put(bytes, face.corners.data(), face.corners.size());
  }
  return bytes;
}

std::optional<std::vector<FaceTriangles>> decode_faces(std::string_view bytes) {
  std::vector<FaceTriangles> faces;
  Left left;
  while (!bytes.empty())
    if (!take_face(bytes, faces.emplace_back(), left)) return std::nullopt;
  return faces;
}

}  // namespace varimesh::geometry
