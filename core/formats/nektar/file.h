// A Nektar++ file as it is: lists of vertices, edges, faces, elements and curves with their numbers. Internal to
// core/formats.
//
// Sources: Nektar++ user guide, chapter "XML Session File", section "Geometry"; for compressed files the documentation
// of the structures in SpatialDomains/MeshEntities.hpp (64-bit numbers, then zlib, then base64).
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/io/scanner.h"
#include "core/base/team.h"
#include "core/formats/common/file_allowance.h"
#include "core/formats/xml/xml.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

/// The numbers of a list of things, which need not be consecutive. Takes no memory while they are 0, 1, 2, …
class NektarIds {
 public:
  void add(std::int64_t id);
  /// Whether they are 0, 1, 2, …
  bool are_consecutive() const { return ids_.empty(); }
  /// Must be called after the last add(). Returns false, and a number that occurs twice, if there is one.
  bool finish(std::int64_t& twice);
  /// The position of a number in the list; −1 if it is not there.
  std::int32_t find(std::int64_t id) const;
  std::int64_t operator[](std::size_t i) const { return ids_.empty() ? std::int64_t(i) : ids_[i]; }
  std::size_t size() const { return count_; }

  /// What finish() takes for each number at most, while the list of pairs grows.
  static constexpr std::size_t kSortedBytes = 2 * sizeof(std::pair<std::int64_t, std::int32_t>);

 private:
  std::size_t count_ = 0;
  std::vector<std::int64_t> ids_;                              ///< Empty if they are 0, 1, 2, …
  std::vector<std::pair<std::int64_t, std::int32_t>> sorted_;  ///< The same.
};

/// Faces or elements: a shape and the numbers of their edges or faces.
struct NektarParts {
  NektarIds ids;
  std::vector<Shape> shapes;
  std::vector<std::int32_t> sides;  ///< One after another: as many as each shape has.
};

/// Compressed files list the elements of each shape by themselves; their numbers tell the order.
void sort_parts(NektarParts& parts);

/// The kinds of points on curves.
enum class NektarPoints : std::uint8_t { EvenlySpaced, GaussLobatto, OtherTriangle };

/// A curved edge or face.
struct NektarCurve {
  std::int32_t id = 0;      ///< Of the edge, face or, in 2-D, element.
  std::uint32_t first = 0;  ///< Its first point in NektarFile::points, or in NektarFile::index of a compressed file.
  std::int16_t count = 0;
  NektarPoints points = NektarPoints::EvenlySpaced;
};

/// The text of a curve of a file that is not compressed.
struct NektarCurveText {
  std::size_t begin = 0;  ///< Byte of the file.
  std::uint32_t length = 0;
  std::int32_t count = 0;  ///< Points.
};

struct NektarComposite {
  std::int64_t id = 0;
  std::string name;
  XmlText text;
};

struct NektarFile {
  std::string_view bytes;
  int dimension = 0;
  bool compressed = false;
  NektarIds vertex_ids, edge_ids;
  std::vector<double> vertices;     ///< Three numbers for each.
  std::vector<std::int32_t> edges;  ///< Numbers of two vertices for each.
  NektarParts faces, elements;      ///< In 2-D there are no faces.
  std::vector<NektarCurve> curved_edges, curved_faces;
  std::vector<double> points;                           ///< Three numbers for each point of a curve, if they are kept.
  std::vector<XmlText> points_text;                     ///< Otherwise the list of points of a compressed file,
  std::vector<NektarCurveText> edge_texts, face_texts;  ///< or the text of each curve.
  std::vector<std::int32_t> index;  ///< In compressed files: numbers of points. Empty if they are 0, 1, 2, …
  std::size_t indices = 0;          ///< How many numbers INDEX has.
  std::vector<NektarComposite> composites;
  std::vector<ForeignSection> others;  ///< Everything outside the geometry, and the domain.

  bool has_texts() const { return !edge_texts.empty() || !face_texts.empty(); }
  /// The number of a point at a place of INDEX.
  std::size_t number_of_point(std::size_t place) const { return index.empty() ? place : std::size_t(index[place]); }
  /// Point k of a curve. The curve must have been checked.
  const double* point(const NektarCurve& curve, std::size_t k) const {
    return points.data() + 3 * number_of_point(curve.first + k);
  }
};

/// The number of edges of a face, or of faces of an element.
int nektar_sides(Shape shape);

/// The letter of a shape in Nektar++'s files: T, Q, A, P, R, H; E for edges, V for vertices.
char nektar_letter(Shape shape);

/// Reads the lists. Their numbers are unique, but may refer to things that are not there. Throws ReadFailure.
/// `keeps_points`: whether the points of curves are read too. Call it inside team.run().
NektarFile parse_nektar(std::string_view bytes, bool keeps_points, FileAllowance& allowance, const Team& team);

/// A compressed list of a file.
struct NektarPackedList {
  enum class Kind : std::uint8_t { Vertices, Edges, Faces, Elements, CurvedEdges, CurvedFaces, Index, Points };
  Kind kind;
  Shape shape;  ///< Of faces and elements.
  XmlText text;
};

/// Unpacks the lists of a file; threads share them. Throws ReadFailure.
void unpack_nektar_lists(NektarFile& file, const std::vector<NektarPackedList>& lists, FileAllowance& allowance,
                         const Team& team);

/// Calls body(bytes, done) for the content of a compressed list in pieces of whole records; `done`: how many bytes of
/// the text these pieces come from. Throws ReadFailure.
void unpack_nektar(std::string_view file, XmlText text, std::size_t record,
                   const std::function<void(std::string_view bytes, std::size_t done)>& body);

/// The kind of points of the curve of an edge or face, by name. Throws ReadFailure.
NektarPoints nektar_points_of(const Scanner& scan, std::int64_t curve, std::string_view name);

/// Returns `count` as the number of points on a curve. Throws ReadFailure if it is larger than any curve can have.
std::int16_t nektar_count_of(const Scanner& scan, std::int64_t count);

/// What a point is called whose coordinate is not finite: a point of a curve in a file of text, and one of the points
/// of a compressed file.
inline std::string nektar_curve_point() { return "a point of a curve"; }
inline std::string nektar_packed_point(std::size_t point) {
  return "point " + std::to_string(point) + " (counted from 0) of DATAPOINTS";
}

/// Whether this may be the number of an entry; a file cannot have more than fit into 32 bits.
inline bool is_nektar_number(std::int64_t number) {
  return number >= 0 && number <= std::numeric_limits<std::int32_t>::max();
}
[[noreturn]] void fail_nektar_number(const Scanner& scan, std::int64_t number);

/// The points of every curve must be in the index and, if they are kept, in the file. Throws ReadFailure.
void check_nektar_points(const NektarFile& file, bool keeps_points);

/// A point of a compressed file.
struct NektarPackedPoint {
  std::int64_t id;
  double x[3];
};

/// The vertices of the faces and cells of a file.
struct NektarCorners {
  std::vector<std::int32_t> faces;  ///< In the order of the face's edges, `per_face` numbers each.
  std::size_t per_face = 4;         ///< 3 if all are triangles.
  std::vector<std::int32_t> cells;  ///< Of all cells, in Gmsh's order, in the order of Nektar++'s corners.

  std::span<const std::int32_t> face(std::size_t f, Shape shape) const {
    return {faces.data() + per_face * f, shape == Shape::Triangle ? 3U : 4U};
  }
};

/// Finds them, replaces the vertices of edges by their positions in the file, and forgets the sides of faces and
/// elements. Throws ReadFailure if edges or faces are missing or do not fit together.
NektarCorners nektar_corners(NektarFile& file, FileAllowance& allowance);

/// Names in HighOrderMesh::foreign: the section of the domain, and the notes that the lists are text and which tag
/// composite 0 got.
inline constexpr std::string_view kNektarDomain = "DOMAIN", kNektarText = "text", kNektarZero = "composite 0";

}  // namespace varimesh::formats
