// Writes Nektar++'s XML files, as text or compressed.
#include <algorithm>
#include <memory>
#include <utility>

#include "core/base/io/buffered_output.h"
#include "core/formats/mfem/shared_sides.h"
#include "core/formats/mfem/space.h"
#include "core/formats/nektar/composites.h"
#include "core/formats/nektar/grid.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/nektar/packed.h"
#include "core/formats/numbering/node_order.h"
#include "core/mesh/connectivity.h"

namespace varimesh::formats {

namespace {

const double* at(const HighOrderMesh& mesh, std::int32_t node) {
  return mesh.coordinates.data() + 3 * std::ptrdiff_t(node);
}

class Writer {
 public:
  Writer(const NektarGrid& grid, bool compressed, BufferedOutput& out)
      : grid_(grid), mesh_(grid.mesh), compressed_(compressed), out_(out) {}

  void write() {
    out_.text("<?xml version=\"1.0\" encoding=\"utf-8\" ?>\n<NEKTAR>\n    <GEOMETRY DIM=\"");
    out_.text_integer(mesh_.dimension);
    out_.text("\" SPACE=\"");
    out_.text_integer(space());
    out_.text("\">\n");
    vertices();
    edges();
    if (mesh_.dimension == 3) faces();
    elements();
    if (mesh_.order > 1) compressed_ ? packed_curves() : text_curves();
    write_nektar_sections(grid_, out_);
    out_.text("</NEKTAR>\n");
  }

 private:
  int space() const {
    if (mesh_.dimension == 3) return 3;
    for (std::size_t i = 2; i < mesh_.coordinates.size(); i += 3)
      if (mesh_.coordinates[i] != 0) return 3;
    return 2;
  }

  void open(const char* section, bool packed) {
    out_.text("        <");
    out_.text(section);
    if (packed) out_.text(" COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\"");
    out_.text(">");
    if (!packed || std::string_view(section) == "CURVED") out_.text("\n");
  }
  void close(const char* section, bool packed) {
    out_.text(packed ? "</" : "        </");
    out_.text(section);
    out_.text(">\n");
  }
  /// The tag of an entry with its number, and attributes that follow.
  static void begin_entry(BufferedOutput& out, char letter, std::int64_t id) {
    out.text("            <");
    out.text({&letter, 1});
    out.text(" ID=\"");
    out.text_integer(id);
    out.text("\"");
  }
  static void entry(BufferedOutput& out, char letter, std::int64_t id, std::string_view attributes = "") {
    begin_entry(out, letter, id);
    out.text(attributes);
    out.text(">");
  }
  static void end_entry(BufferedOutput& out, char letter) {
    out.text("</");
    out.text({&letter, 1});
    out.text(">\n");
  }
  void point(BufferedOutput& out, std::int32_t number) const {
    const double* x = at(mesh_, grid_.points()[std::size_t(number)]);
    for (int k = 0; k < 3; ++k) {
      out.text_number(x[k]);
      if (k < 2) out.text(" ");
    }
  }
  template <class Numbers>
  static void integers(BufferedOutput& out, const Numbers& numbers) {
    bool first = true;
    for (const std::int32_t number : numbers) {
      if (!std::exchange(first, false)) out.text(" ");
      out.text_integer(number);
    }
  }

  // === Vertices, edges, faces, elements ==================================================================

  static constexpr std::size_t kEntriesPerPiece = 4096;

  void vertices() {
    open("VERTEX", compressed_);
    if (compressed_) {
      write_packed(out_, PackedValues::Coordinates, grid_.vertex_count(), 32,
                   [&](std::size_t begin, std::size_t end, std::string& bytes) { pack_points(begin, end, bytes); });
    } else {
      out_.shared(grid_.vertex_count(), kEntriesPerPiece, [&](BufferedOutput& out, std::size_t begin, std::size_t end) {
        for (std::size_t v = begin; v < end; ++v) {
          entry(out, 'V', std::int64_t(v));
          point(out, std::int32_t(v));
          end_entry(out, 'V');
        }
      });
    }
    close("VERTEX", compressed_);
  }

  void pack_points(std::size_t begin, std::size_t end, std::string& bytes) const {
    for (std::size_t i = begin; i < end; ++i) {
      append_packed(bytes, std::int64_t(i));
      append_packed(bytes, at(mesh_, grid_.points()[i]));
    }
  }

  void edges() {
    open("EDGE", compressed_);
    if (compressed_) {
      write_packed(out_, PackedValues::Integers, grid_.edge_count(), 24,
                   [&](std::size_t begin, std::size_t end, std::string& bytes) {
                     grid_.for_edges(begin, end, [&](std::size_t edge, const std::array<std::int32_t, 2>& vertices) {
                       append_packed(bytes, std::int64_t(edge));
                       for (const std::int32_t vertex : vertices) append_packed(bytes, std::int64_t(vertex));
                     });
                   });
    } else {
      out_.shared(grid_.edge_count(), kEntriesPerPiece, [&](BufferedOutput& out, std::size_t begin, std::size_t end) {
        grid_.for_edges(begin, end, [&](std::size_t edge, const std::array<std::int32_t, 2>& vertices) {
          entry(out, 'E', std::int64_t(edge));
          integers(out, vertices);
          end_entry(out, 'E');
        });
      });
    }
    close("EDGE", compressed_);
  }

  void faces() {
    parts(
        "FACE", grid_.face_count(), [&](Shape shape) { return grid_.has_faces(shape); },
        [&](std::size_t begin, std::size_t end, const auto& body) {
          grid_.for_faces(begin, end, [&](std::size_t face, Shape shape, std::span<const std::int32_t> vertices) {
            body(face, shape, [&] { return grid_.edges_around(vertices); });
          });
        });
  }
  void elements() {
    parts(
        "ELEMENT", grid_.cells.count(),
        [&](Shape shape) {
          return std::any_of(grid_.cells.ranges().begin(), grid_.cells.ranges().end(),
                             [&](const Cells::Range& range) { return range.block->shape == shape; });
        },
        [&](std::size_t begin, std::size_t end, const auto& body) {
          grid_.for_cells(begin, end, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> vertices) {
            body(cell, shape, [&] { return grid_.sides(shape, vertices); });
          });
        });
  }

  /// Writes faces or elements. visit(begin, end, body) calls body(number, shape, sides), and sides() returns the
  /// numbers of its edges or faces. In compressed files each shape has a list of its own.
  template <class Has, class Visit>
  void parts(const char* section, std::size_t count, const Has& has, const Visit& visit) {
    open(section, false);
    for (int s = int(Shape::Triangle); compressed_ && s < kShapes; ++s) {
      const auto wanted = Shape(s);
      if (!has(wanted)) continue;
      const char letter = nektar_letter(wanted);
      out_.text("            <" + std::string(1, letter) + " COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\">");
      write_packed(out_, PackedValues::Integers, count, 40,
                   [&](std::size_t begin, std::size_t end, std::string& bytes) {
                     visit(begin, end, [&](std::size_t number, Shape shape, const auto& sides) {
                       if (shape != wanted) return;
                       append_packed(bytes, std::int64_t(number));
                       const NektarSides found = sides();
                       for (const std::int32_t side : std::span<const std::int32_t>(found))
                         append_packed(bytes, std::int64_t(side));
                     });
                   });
      end_entry(out_, letter);
    }
    if (!compressed_)
      out_.shared(count, kEntriesPerPiece, [&](BufferedOutput& out, std::size_t begin, std::size_t end) {
        visit(begin, end, [&](std::size_t number, Shape shape, const auto& sides) {
          const NektarSides found = sides();
          entry(out, nektar_letter(shape), std::int64_t(number));
          integers(out, std::span<const std::int32_t>(found));
          end_entry(out, nektar_letter(shape));
        });
      });
    close(section, false);
  }

  // === Curves ============================================================================================

  // All edges are curves; in 3-D those faces that have points inside, in 2-D those cells.

  std::size_t face_count() const { return mesh_.dimension == 3 ? grid_.face_count() : grid_.cells.count(); }
  bool curves(Shape shape) const { return inner_node_count(shape, mesh_.order) > 0; }
  std::size_t points_on_edges() const { return grid_.edge_count() * std::size_t(mesh_.order + 1); }

  /// Calls body(number of the curve, its first point in the index, its face, its points in the file's order, shape) for
  /// the curves among the faces from begin to end − 1.
  template <class Body>
  void for_curved_faces(std::size_t begin, std::size_t end, const Body& body) const {
    std::vector<std::int32_t> points, ordered;
    const auto before = curves_before(begin);
    std::size_t number = before.first, first = before.second;
    const auto visit = [&](std::size_t face, Shape shape, std::span<const std::int32_t> vertices) {
      if (!curves(shape)) return;
      points.resize(std::size_t(reference::node_count(shape, mesh_.order)));
      grid_.points_of(shape, vertices, mesh_.dimension == 2 ? grid_.interior(face) : 0, points);
      ordered.clear();
      for (const int local : gmsh_nodes(NodeOrder::Nektar, shape, mesh_.order))
        ordered.push_back(points[std::size_t(local)]);
      body(number++, first, face, std::span<const std::int32_t>(ordered), shape);
      first += ordered.size();
    };
    mesh_.dimension == 3 ? grid_.for_faces(begin, end, visit) : grid_.for_cells(begin, end, visit);
  }

  /// The number of curves, and of their points and those of edges, before a face.
  std::pair<std::size_t, std::size_t> curves_before(std::size_t face) const {
    std::size_t triangles = 0, quadrilaterals = 0;
    if (mesh_.dimension == 3) {
      triangles = grid_.triangles_before(face);
      quadrilaterals = face - triangles;
    } else {
      for (const Cells::Range& range : grid_.cells.ranges()) {
        const std::size_t before = std::min(face - std::min(face, range.first), range.block->size());
        (range.block->shape == Shape::Triangle ? triangles : quadrilaterals) += before;
      }
    }
    std::pair<std::size_t, std::size_t> before(0, points_on_edges());
    for (const auto& [shape, count] : {std::pair(Shape::Triangle, triangles), {Shape::Quadrilateral, quadrilaterals}}) {
      if (!curves(shape)) continue;
      before.first += count;
      before.second += count * std::size_t(reference::node_count(shape, mesh_.order));
    }
    return before;
  }

  /// Calls body(edge, its points in order).
  template <class Body>
  void for_curved_edges(std::size_t begin, std::size_t end, const Body& body) const {
    std::vector<std::int32_t> points(std::size_t(mesh_.order) + 1);
    grid_.for_edges(begin, end, [&](std::size_t edge, const std::array<std::int32_t, 2>& vertices) {
      points.front() = vertices[0];
      for (std::size_t k = 1; k + 1 < points.size(); ++k)
        points[k] = std::int32_t(grid_.vertex_count() + edge * (points.size() - 2) + k - 1);
      points.back() = vertices[1];
      body(edge, std::span<const std::int32_t>(points));
    });
  }

  void text_curves() {
    open("CURVED", false);
    out_.shared(grid_.edge_count(), kEntriesPerPiece, [&](BufferedOutput& out, std::size_t begin, std::size_t end) {
      for_curved_edges(begin, end, [&](std::size_t edge, std::span<const std::int32_t> points) {
        text_curve(out, 'E', edge, edge, Shape::Line, points);
      });
    });
    out_.shared(face_count(), kEntriesPerPiece, [&](BufferedOutput& out, std::size_t begin, std::size_t end) {
      for_curved_faces(begin, end, [&](std::size_t number, std::size_t, std::size_t face, auto points, Shape shape) {
        text_curve(out, 'F', number, face, shape, points);
      });
    });
    close("CURVED", false);
  }

  void text_curve(BufferedOutput& out, char letter, std::size_t number, std::size_t of, Shape shape,
                  std::span<const std::int32_t> points) const {
    begin_entry(out, letter, std::int64_t(number));
    out.text(letter == 'E' ? " EDGEID=\"" : " FACEID=\"");
    out.text_integer(std::int64_t(of));
    out.text("\" NUMPOINTS=\"");
    out.text_integer(std::int64_t(points.size()));
    out.text(shape == Shape::Triangle ? "\" TYPE=\"NodalTriEvenlySpaced\">" : "\" TYPE=\"PolyEvenlySpaced\">");
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (k > 0) out.text("  ");
      point(out, points[k]);
    }
    end_entry(out, letter);
  }

  /// A list of edges, one of faces, and one set of points for both. As in NekMesh's files, every point is there once,
  /// and the index names those of each curve.
  void packed_curves() {
    open("CURVED", true);
    if (grid_.edge_count() > 0)
      packed("E", grid_.edge_count(), 48, [&](std::size_t begin, std::size_t end, std::string& bytes) {
        const auto count = std::size_t(mesh_.order) + 1;
        for (std::size_t e = begin; e < end; ++e) append_info(bytes, e, e, count, e * count, Shape::Line);
      });
    if (curves_before(face_count()).first > 0)
      packed("F", face_count(), 48, [&](std::size_t begin, std::size_t end, std::string& bytes) {
        for_curved_faces(begin, end,
                         [&](std::size_t number, std::size_t first, std::size_t face, auto points, Shape s) {
                           append_info(bytes, number, face, points.size(), first, s);
                         });
      });
    out_.text("            <DATAPOINTS ID=\"0\">\n");
    packed_index();
    packed(
        "POINTS", grid_.points().size(), 32,
        [&](std::size_t begin, std::size_t end, std::string& bytes) { pack_points(begin, end, bytes); },
        PackedValues::Coordinates);
    out_.text("            </DATAPOINTS>\n");
    close("CURVED", false);
  }

  void packed_index() {
    // Edges first, then faces, in one list.
    const std::size_t edges = grid_.edge_count();
    const std::size_t bytes_each = 8 * std::size_t(reference::node_count(Shape::Quadrilateral, mesh_.order));
    packed("INDEX", edges + face_count(), bytes_each, [&](std::size_t begin, std::size_t end, std::string& bytes) {
      const auto append = [&](std::span<const std::int32_t> points) {
        for (const std::int32_t point : points) append_packed(bytes, std::int64_t(point));
      };
      for_curved_edges(std::min(begin, edges), std::min(end, edges),
                       [&](std::size_t, std::span<const std::int32_t> points) { append(points); });
      if (end > edges)
        for_curved_faces(std::max(begin, edges) - edges, end - edges,
                         [&](std::size_t, std::size_t, std::size_t, auto points, Shape) { append(points); });
    });
  }

  static void append_info(std::string& bytes, std::size_t number, std::size_t of, std::size_t count, std::size_t first,
                          Shape shape) {
    constexpr std::size_t kEvenlySpaced = 17, kEvenlySpacedTriangle = 24;  // in Nektar++'s PointsType
    const std::size_t type = shape == Shape::Triangle ? kEvenlySpacedTriangle : kEvenlySpaced;
    for (const std::size_t value : {number, of, count, std::size_t(0), first, type})
      append_packed(bytes, std::int64_t(value));
  }

  template <class Fill>
  void packed(const char* name, std::size_t count, std::size_t bytes_each, const Fill& fill,
              PackedValues values = PackedValues::Integers) {
    out_.text("            <" + std::string(name) + ">");
    write_packed(out_, values, count, bytes_each, fill);
    out_.text("</" + std::string(name) + ">\n");
  }

  const NektarGrid& grid_;
  const HighOrderMesh& mesh_;
  const bool compressed_;
  BufferedOutput& out_;
};

}  // namespace

namespace {

/// The grid of a mesh whose elements share their sides as Nektar++ needs it.
Expected<std::unique_ptr<NektarGrid>> make_grid(const HighOrderMesh& mesh, const Team& team) {
  constexpr std::string_view kFormat = "Nektar++'s";
  if (auto distinct = check_distinct_vertices(Cells(mesh, mesh.dimension), kFormat); !distinct)
    return tl::unexpected(distinct.error());
  auto vertices = nektar_vertices(mesh);
  if (!vertices) return tl::unexpected(vertices.error());
  auto grid = std::make_unique<NektarGrid>(mesh, std::move(*vertices), team);
  if (const auto cell = grid->unshared_side(team)) return unshared_side(grid->cells, *cell, kFormat);
  return grid;
}

}  // namespace

Expected<void> check_nektar_sides(const HighOrderMesh& mesh, const Team& team) {
  if (mesh.dimension < 2) return {};
  if (const auto grid = make_grid(mesh, team); !grid) return tl::unexpected(grid.error());
  return {};
}

Expected<void> write_nektar(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField>,
                            const Team& team) {
  if (mesh.dimension < 2) return bad_option("VariMesh writes Nektar++'s meshes of dimension 2 and 3 only; write vtu.");
  const auto made = make_grid(mesh, team);
  if (!made) return tl::unexpected(made.error());
  const NektarGrid& grid = **made;
  BufferedOutput out(sink, false, team);
  const auto says_text = [](const ForeignSection& part) { return part.format == "nektar" && part.name == kNektarText; };
  Writer(grid, std::ranges::none_of(mesh.foreign, says_text), out).write();
  return out.finish();
}

}  // namespace varimesh::formats
