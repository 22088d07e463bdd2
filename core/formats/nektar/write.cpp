// Writes Nektar++'s XML files, as text or compressed.
#include <algorithm>
#include <map>

#include "core/formats/buffered_output.h"
#include "core/formats/mfem/shared_sides.h"
#include "core/formats/mfem/space.h"
#include "core/formats/nektar/composites.h"
#include "core/formats/nektar/grid.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/nektar/packed.h"
#include "core/formats/node_order.h"
#include "core/formats/xml/xml.h"
#include "core/mesh/connectivity.h"

namespace varimesh::formats {

namespace {

bool has_dimension(const ElementBlock& block, int dimension) {
  return reference::info(block.shape).dimension == dimension;
}

const double* at(const HighOrderMesh& mesh, std::int32_t node) {
  return mesh.coordinates.data() + 3 * std::ptrdiff_t(node);
}

class Writer {
 public:
  Writer(const NektarGrid& grid, bool compressed, BufferedOutput& out)
      : grid_(grid), mesh_(grid.mesh), cells_(grid.mesh, grid.mesh.dimension), compressed_(compressed), out_(out) {}

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
    if (mesh_.order > 1) compressed_ ? packed_curves() : curves();
    const NektarComposites composites = nektar_composites(mesh_);
    write_composites(composites);
    write_domain(composites);
    out_.text("    </GEOMETRY>\n");
    write_others(composites);
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
  void entry(char letter, std::int64_t id, std::string_view attributes = "") {
    out_.text("            <");
    out_.text({&letter, 1});
    out_.text(" ID=\"");
    out_.text_integer(id);
    out_.text("\"");
    out_.text(attributes);
    out_.text(">");
  }
  void end_entry(char letter) {
    out_.text("</");
    out_.text({&letter, 1});
    out_.text(">\n");
  }
  void point(const double* x) {
    for (int k = 0; k < 3; ++k) {
      out_.text_number(x[k]);
      if (k < 2) out_.text(" ");
    }
  }

  // === Vertices, edges, faces, elements ==================================================================

  void vertices() {
    open("VERTEX", compressed_);
    if (compressed_) {
      write_packed(out_, grid_.vertex_nodes.size(), 32, [&](std::size_t begin, std::size_t end, std::string& bytes) {
        for (std::size_t v = begin; v < end; ++v) {
          append_packed(bytes, std::int64_t(v));
          append_packed(bytes, at(mesh_, grid_.vertex_nodes[v]));
        }
      });
    } else {
      for (std::size_t v = 0; v < grid_.vertex_nodes.size(); ++v) {
        entry('V', std::int64_t(v));
        point(at(mesh_, grid_.vertex_nodes[v]));
        end_entry('V');
      }
    }
    close("VERTEX", compressed_);
  }

  void edges() {
    open("EDGE", compressed_);
    if (compressed_) {
      write_packed(out_, grid_.edges.size(), 24, [&](std::size_t begin, std::size_t end, std::string& bytes) {
        for (std::size_t e = begin; e < end; ++e)
          for (const std::int64_t value :
               {std::int64_t(e), std::int64_t(grid_.edges[e][0]), std::int64_t(grid_.edges[e][1])})
            append_packed(bytes, value);
      });
    } else {
      for (std::size_t e = 0; e < grid_.edges.size(); ++e) {
        entry('E', std::int64_t(e));
        out_.text_integer(grid_.edges[e][0]);
        out_.text(" ");
        out_.text_integer(grid_.edges[e][1]);
        end_entry('E');
      }
    }
    close("EDGE", compressed_);
  }

  Shape face_shape(std::size_t f) const { return grid_.faces[f][3] < 0 ? Shape::Triangle : Shape::Quadrilateral; }
  std::span<const std::int32_t> face_vertices(std::size_t f) const {
    return {grid_.faces[f].data(), std::size_t(reference::info(face_shape(f)).vertices)};
  }
  void faces() {
    parts(
        "FACE", grid_.faces.size(), [&](std::size_t f) { return face_shape(f); },
        [&](std::size_t f) { return grid_.edges_around(face_vertices(f)); });
  }
  void elements() {
    parts(
        "ELEMENT", cells_.count(), [&](std::size_t cell) { return cells_.shape(cell); },
        [&](std::size_t cell) {
          const Shape shape = cells_.shape(cell);
          const auto all = grid_.vertices_of(shape, cells_.nodes(cell));
          return grid_.sides(shape, {all.data(), std::size_t(reference::info(shape).vertices)});
        });
  }

  /// Writes faces or elements. In compressed files each shape has a list of its own.
  template <class ShapeOf, class SidesOf>
  void parts(const char* section, std::size_t count, const ShapeOf& shape_of, const SidesOf& sides_of) {
    open(section, false);
    if (compressed_) {
      std::map<Shape, std::vector<std::int32_t>> numbers;
      for (std::size_t i = 0; i < count; ++i) numbers[shape_of(i)].push_back(std::int32_t(i));
      for (const auto& [shape, own] : numbers) {
        const char letter = nektar_letter(shape);
        out_.text("            <" + std::string(1, letter) + " COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\">");
        // By name: clang 14 lets no lambda capture a structured binding otherwise.
        write_packed(out_, own.size(), 64, [&, &own = own](std::size_t begin, std::size_t end, std::string& bytes) {
          for (std::size_t i = begin; i < end; ++i) {
            append_packed(bytes, std::int64_t(own[i]));
            for (const std::int64_t side : sides_of(std::size_t(own[i]))) append_packed(bytes, side);
          }
        });
        end_entry(letter);
      }
    } else {
      for (std::size_t i = 0; i < count; ++i) {
        const char letter = nektar_letter(shape_of(i));
        entry(letter, std::int64_t(i));
        const std::vector<std::int64_t> sides = sides_of(i);
        for (std::size_t k = 0; k < sides.size(); ++k) {
          if (k > 0) out_.text(" ");
          out_.text_integer(sides[k]);
        }
        end_entry(letter);
      }
    }
    close(section, false);
  }

  // === Curves ============================================================================================

  /// Edges, or faces that have nodes inside; in 2-D elements that have.
  struct Curves {
    Shape shape = Shape::Line;  ///< Of edges.
    std::vector<std::int32_t> numbers;
    std::vector<std::int64_t> first;  ///< The first point of each, and the end.
  };

  Shape shape_of(const Curves& curves, std::size_t i) const {
    if (curves.shape == Shape::Line) return Shape::Line;
    const auto number = std::size_t(curves.numbers[i]);
    return mesh_.dimension == 3 ? face_shape(number) : cells_.shape(number);
  }
  /// The nodes in the file's order.
  std::vector<std::int32_t> nodes_of(const Curves& curves, std::size_t i) const {
    const Shape shape = shape_of(curves, i);
    const auto number = std::size_t(curves.numbers[i]);
    std::vector<std::int32_t> own;
    std::span<const std::int32_t> nodes;
    if (shape != Shape::Line && mesh_.dimension == 2) {
      nodes = cells_.nodes(number);
    } else {
      own = shape == Shape::Line ? grid_.nodes_of(shape, grid_.edges[number])
                                 : grid_.nodes_of(shape, face_vertices(number));
      nodes = own;
    }
    std::vector<std::int32_t> ordered;
    for (const int local : gmsh_nodes(NodeOrder::Nektar, shape, mesh_.order))
      ordered.push_back(nodes[std::size_t(local)]);
    return ordered;
  }

  Curves curves_of(Shape shape, std::int64_t first) const {
    Curves curves{shape, {}, {first}};
    const std::size_t count = shape == Shape::Line   ? grid_.edges.size()
                              : mesh_.dimension == 3 ? grid_.faces.size()
                                                     : cells_.count();
    for (std::size_t i = 0; i < count; ++i) {
      curves.numbers.push_back(std::int32_t(i));
      const Shape own = shape_of(curves, curves.numbers.size() - 1);
      if (inner_node_count(own, mesh_.order) > 0)
        curves.first.push_back(curves.first.back() + reference::node_count(own, mesh_.order));
      else
        curves.numbers.pop_back();
    }
    return curves;
  }

  void curves() {
    open("CURVED", false);
    for (const Shape shape : {Shape::Line, Shape::Triangle}) {
      const Curves all = curves_of(shape, 0);
      for (std::size_t i = 0; i < all.numbers.size(); ++i) curve(all, i);
    }
    close("CURVED", false);
  }

  void curve(const Curves& curves, std::size_t i) {
    const std::vector<std::int32_t> nodes = nodes_of(curves, i);
    const bool edges = curves.shape == Shape::Line;
    const char letter = edges ? 'E' : 'F';
    entry(letter, std::int64_t(i),
          (edges ? " EDGEID=\"" : " FACEID=\"") + std::to_string(curves.numbers[i]) + "\" NUMPOINTS=\"" +
              std::to_string(nodes.size()) + "\" TYPE=\"" +
              (shape_of(curves, i) == Shape::Triangle ? "NodalTriEvenlySpaced" : "PolyEvenlySpaced") + "\"");
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      if (k > 0) out_.text("  ");
      point(at(mesh_, nodes[k]));
    }
    end_entry(letter);
  }

  /// A list of edges, one of faces, and one set of points for both.
  void packed_curves() {
    const Curves edges = curves_of(Shape::Line, 0), faces = curves_of(Shape::Triangle, edges.first.back());
    open("CURVED", true);
    if (!edges.numbers.empty()) packed_list("E", edges);
    if (!faces.numbers.empty()) packed_list("F", faces);
    out_.text("            <DATAPOINTS ID=\"0\">\n");
    packed("INDEX", std::size_t(faces.first.back()), 8, [&](std::size_t begin, std::size_t end, std::string& bytes) {
      for (std::size_t i = begin; i < end; ++i) append_packed(bytes, std::int64_t(i));
    });
    const std::size_t all = edges.numbers.size() + faces.numbers.size(),
                      bytes_all = 32 * std::size_t(faces.first.back());
    packed("POINTS", all, bytes_all / std::max<std::size_t>(1, all),
           [&](std::size_t begin, std::size_t end, std::string& bytes) {
             for (std::size_t i = begin; i < end; ++i) {
               const bool is_edge = i < edges.numbers.size();
               const Curves& own = is_edge ? edges : faces;
               const std::size_t k = is_edge ? i : i - edges.numbers.size();
               std::int64_t number = own.first[k];
               for (const std::int32_t node : nodes_of(own, k)) {
                 append_packed(bytes, number++);
                 append_packed(bytes, at(mesh_, node));
               }
             }
           });
    out_.text("            </DATAPOINTS>\n");
    close("CURVED", false);
  }

  void packed_list(const char* name, const Curves& curves) {
    constexpr std::int64_t kEvenlySpaced = 17, kEvenlySpacedTriangle = 24;  // in Nektar++'s PointsType
    packed(name, curves.numbers.size(), 48, [&](std::size_t begin, std::size_t end, std::string& bytes) {
      for (std::size_t i = begin; i < end; ++i)
        for (const std::int64_t value :
             {std::int64_t(i), std::int64_t(curves.numbers[i]), curves.first[i + 1] - curves.first[i], std::int64_t(0),
              curves.first[i], shape_of(curves, i) == Shape::Triangle ? kEvenlySpacedTriangle : kEvenlySpaced})
          append_packed(bytes, value);
    });
  }

  template <class Fill>
  void packed(const char* name, std::size_t count, std::size_t bytes_each, const Fill& fill) {
    out_.text("            <" + std::string(name) + ">");
    write_packed(out_, count, bytes_each, fill);
    out_.text("</" + std::string(name) + ">\n");
  }

  // === Composites and the rest ===========================================================================

  void write_composites(const NektarComposites& composites) {
    std::vector<std::int64_t> first(mesh_.blocks.size(), 0);  // the number of each block's first cell
    std::int64_t next = 0;
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b)
      if (has_dimension(mesh_.blocks[b], mesh_.dimension)) {
        first[b] = next;
        next += std::int64_t(mesh_.blocks[b].size());
      }
    open("COMPOSITE", false);
    for (const NektarComposites::One& one : composites.all) {
      std::map<char, std::vector<std::int64_t>> numbers;
      for (const std::size_t b : one.blocks) {
        const ElementBlock& block = mesh_.blocks[b];
        const auto count = std::size_t(reference::node_count(block.shape, block.order));
        if (one.dimension == mesh_.dimension) {
          auto& list = numbers[nektar_letter(block.shape)];
          for (std::size_t e = 0; e < block.size(); ++e) list.push_back(first[b] + std::int64_t(e));
          continue;
        }
        auto& list = numbers[one.dimension == 1 ? 'E' : 'F'];
        for (std::size_t e = 0; e < block.size(); ++e)
          if (const std::int32_t side = grid_.side(block.shape, {block.nodes.data() + e * count, count}); side >= 0)
            list.push_back(side);
      }
      std::erase_if(numbers, [](const auto& list) { return list.second.empty(); });
      if (numbers.empty()) continue;
      entry('C', one.id, one.name.empty() ? "" : " NAME=\"" + escaped_xml(one.name) + "\"");
      for (const auto& [letter, list] : numbers) {
        out_.text(" ");
        out_.text(nektar_list(letter, list));
      }
      out_.text(" ");
      end_entry('C');
    }
    close("COMPOSITE", false);
  }

  void write_domain(const NektarComposites& composites) {
    for (const ForeignSection& section : mesh_.foreign)
      if (section.format == "nektar" && section.name == kNektarDomain)
        return out_.text("        " + section.bytes + "\n");
    out_.text("        <DOMAIN> C[");
    out_.text(composites.domain);
    out_.text("] </DOMAIN>\n");
  }

  static bool is_note(std::string_view name) {
    return name == kNektarDomain || name == kNektarText || name == kNektarZero;
  }

  void write_others(const NektarComposites& composites) {
    bool expansions = false;
    for (const ForeignSection& section : mesh_.foreign) {
      if (section.format != "nektar" || is_note(section.name)) continue;
      expansions = expansions || section.name == "EXPANSIONS";
      out_.text("    ");
      out_.text(section.bytes);
      out_.text("\n");
    }
    if (expansions) return;
    out_.text("    <EXPANSIONS>\n        <E COMPOSITE=\"C[");
    out_.text(composites.domain);
    out_.text("]\" NUMMODES=\"");
    out_.text_integer(std::max(4, mesh_.order + 1));
    out_.text("\" TYPE=\"MODIFIED\" FIELDS=\"u\" />\n    </EXPANSIONS>\n");
  }

  const NektarGrid& grid_;
  const HighOrderMesh& mesh_;
  const Cells cells_;
  const bool compressed_;
  BufferedOutput& out_;
};

}  // namespace

Expected<void> write_nektar(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField>,
                            const Team& team) {
  if (mesh.dimension < 2) return bad_option("VariMesh writes Nektar++'s meshes of dimension 2 and 3 only; write vtu.");
  if (auto shared = check_shared_sides(mesh, "Nektar++'s", team); !shared) return shared;
  auto vertices = nektar_vertices(mesh);
  if (!vertices) return tl::unexpected(vertices.error());
  const NektarGrid grid(mesh, std::move(*vertices), team);
  BufferedOutput out(sink, false, team);
  const auto says_text = [](const ForeignSection& part) { return part.format == "nektar" && part.name == kNektarText; };
  Writer(grid, std::ranges::none_of(mesh.foreign, says_text), out).write();
  return out.finish();
}

}  // namespace varimesh::formats
