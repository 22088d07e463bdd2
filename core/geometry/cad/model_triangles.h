// The faces of a CAD model as flat triangles, for a picture of it, and the bytes in which the program that reads CAD
// files hands them over. Internal to the library.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace varimesh::geometry {

/// The triangles of a model are at most these. More make a picture slow, and show nothing more.
inline constexpr int kMostTriangles = 300'000;

/// The triangles of one face. Faces share no nodes, so that each can have normals of its own at its edges.
struct FaceTriangles {
  int tag = 0;                        ///< Surface::tag
  std::vector<double> coordinates;    ///< x, y and z of each node, in the geometry's unit of length.
  std::vector<std::int32_t> corners;  ///< Three nodes per triangle, from 0. Seen from outside, they turn to the left.
  std::string name{};                 ///< Surface::name. It is not among the bytes of encode().
};

/// A model as triangles.
struct ModelTriangles {
  std::vector<FaceTriangles> faces;
  std::vector<std::string> notes;  ///< Sentences about what was taken.
};

std::string encode(const std::vector<FaceTriangles>& faces);
/// The faces whose bytes encode() made. A process that a damaged file has taken over may send any bytes. So nothing is
/// returned unless each face has triangles, all faces together have at most kMostTriangles and no more nodes than these
/// can use, and tags ascend from 1.
std::optional<std::vector<FaceTriangles>> decode_faces(std::string_view bytes);

}  // namespace varimesh::geometry
