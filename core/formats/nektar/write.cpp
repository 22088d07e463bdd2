// Writes Nektar++'s XML files, as text or compressed.
#include <algorithm>
#include <map>

#include "core/formats/buffered_output.h"
#include "core/formats/mfem/space.h"
#include "core/formats/nektar/composites.h"
#include "core/formats/nektar/grid.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/node_order.h"
#include "core/formats/xml/encoding.h"
#include "core/formats/xml/xml.h"

namespace varimesh::formats {

namespace {

bool has_dimension(const ElementBlock& block, int dimension) {
  return reference::info(block.shape).dimension == dimension;
}

const double* at(const HighOrderMesh& mesh, std::int32_t node) {
  return mesh.coordinates.data() + 3 * std::ptrdiff_t(node);
}

/// Numbers of 64 bits and doubles, as compressed files have them.
class Packed {
 public:
  void add(std::int64_t value) { bytes_.append(reinterpret_cast<const char*>(&value), sizeof value); }
  void add(const double* x) { bytes_.append(reinterpret_cast<const char*>(x), 3 * sizeof *x); }

  /// Writes them as text, and forgets them.
  void write(BufferedOutput& out) {
    std::string stream, text;
    // Level 1, because coordinates hardly compress: higher levels take four times as long and save a few per cent.
    deflate_zlib(bytes_, stream, 1);
    encode_base64(stream, text);
    out.text(text);
    bytes_.clear();
  }

 private:
  std::string bytes_;
};

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
    if (mesh_.dimension == 3) parts("FACE", [&](const auto& body) { for_each_face(body); });
    parts("ELEMENT", [&](const auto& body) { for_each_element(body); });
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
    Packed packed;
    open("VERTEX", compressed_);
    for (std::size_t v = 0; v < grid_.vertex_nodes.size(); ++v) {
      const double* x = at(mesh_, grid_.vertex_nodes[v]);
      if (compressed_) {
        packed.add(std::int64_t(v));
        packed.add(x);
        continue;
      }
      entry('V', std::int64_t(v));
      point(x);
      end_entry('V');
    }
    if (compressed_) packed.write(out_);
    close("VERTEX", compressed_);
  }

  void edges() {
    Packed packed;
    open("EDGE", compressed_);
    for (std::size_t e = 0; e < grid_.edges.size(); ++e) {
      const auto& [a, b] = grid_.edges[e];
      if (compressed_) {
        for (const std::int64_t value : {std::int64_t(e), std::int64_t(a), std::int64_t(b)}) packed.add(value);
        continue;
      }
      entry('E', std::int64_t(e));
      out_.text_integer(a);
      out_.text(" ");
      out_.text_integer(b);
      end_entry('E');
    }
    if (compressed_) packed.write(out_);
    close("EDGE", compressed_);
  }

  /// Calls body(shape, number, numbers of the edges) for each face.
  template <class Body>
  void for_each_face(const Body& body) const {
    for (std::size_t f = 0; f < grid_.faces.size(); ++f) {
      const Shape shape = face_shape(f);
      body(shape, std::int64_t(f), grid_.edges_around(face_vertices(f)));
    }
  }
  template <class Body>
  void for_each_element(const Body& body) const {
    std::int64_t number = 0;
    grid_.for_each_cell([&](std::size_t, const ElementBlock& block, auto, std::span<const std::int32_t> vertices) {
      body(block.shape, number++, grid_.sides(block.shape, vertices));
    });
  }
  Shape face_shape(std::size_t f) const { return grid_.faces[f][3] < 0 ? Shape::Triangle : Shape::Quadrilateral; }
  std::span<const std::int32_t> face_vertices(std::size_t f) const {
    return {grid_.faces[f].data(), std::size_t(reference::info(face_shape(f)).vertices)};
  }

  /// Writes faces or elements. In compressed files each shape has a list of its own.
  template <class ForEach>
  void parts(const char* section, const ForEach& for_each) {
    open(section, false);
    if (compressed_) {
      std::map<Shape, Packed> packed;
      for_each([&](Shape shape, std::int64_t number, const std::vector<std::int64_t>& sides) {
        packed[shape].add(number);
        for (const std::int64_t side : sides) packed[shape].add(side);
      });
      for (auto& [shape, numbers] : packed) {
        const char letter = nektar_letter(shape);
        out_.text("            <" + std::string(1, letter) + " COMPRESSED=\"B64Z-LittleEndian\" BITSIZE=\"64\">");
        numbers.write(out_);
        end_entry(letter);
      }
    } else {
      for_each([&](Shape shape, std::int64_t number, const std::vector<std::int64_t>& sides) {
        entry(nektar_letter(shape), number);
        for (std::size_t k = 0; k < sides.size(); ++k) {
          if (k > 0) out_.text(" ");
          out_.text_integer(sides[k]);
        }
        end_entry(nektar_letter(shape));
      });
    }
    close(section, false);
  }

  // === Curves ============================================================================================

  /// Calls body(number of the edge, its nodes in the file's order).
  template <class Body>
  void for_each_curved_edge(const Body& body) const {
    for (std::size_t e = 0; e < grid_.edges.size(); ++e)
      body(std::int64_t(e), in_file_order(Shape::Line, grid_.nodes_of(Shape::Line, grid_.edges[e])));
  }
  /// The same for faces that have nodes inside; in 2-D for elements. body(shape, number, nodes).
  template <class Body>
  void for_each_curved_face(const Body& body) const {
    if (mesh_.dimension == 3) {
      for (std::size_t f = 0; f < grid_.faces.size(); ++f)
        if (inner_node_count(face_shape(f), mesh_.order) > 0)
          body(face_shape(f), std::int64_t(f),
               in_file_order(face_shape(f), grid_.nodes_of(face_shape(f), face_vertices(f))));
      return;
    }
    std::int64_t number = -1;
    grid_.for_each_cell([&](std::size_t, const ElementBlock& block, std::span<const std::int32_t> nodes, auto) {
      ++number;
      if (inner_node_count(block.shape, mesh_.order) > 0) body(block.shape, number, in_file_order(block.shape, nodes));
    });
  }
  std::vector<std::int32_t> in_file_order(Shape shape, std::span<const std::int32_t> nodes) const {
    std::vector<std::int32_t> ordered;
    for (const int local : gmsh_nodes(NodeOrder::Nektar, shape, mesh_.order))
      ordered.push_back(nodes[std::size_t(local)]);
    return ordered;
  }

  void curves() {
    open("CURVED", false);
    std::int64_t id = 0;
    for_each_curved_edge([&](std::int64_t edge, const std::vector<std::int32_t>& nodes) {
      curve('E', id++, "EDGEID", edge, "PolyEvenlySpaced", nodes);
    });
    id = 0;
    for_each_curved_face([&](Shape shape, std::int64_t face, const std::vector<std::int32_t>& nodes) {
      curve('F', id++, "FACEID", face, shape == Shape::Triangle ? "NodalTriEvenlySpaced" : "PolyEvenlySpaced", nodes);
    });
    close("CURVED", false);
  }

  void curve(char letter, std::int64_t id, const char* name, std::int64_t of, const char* type,
             const std::vector<std::int32_t>& nodes) {
    entry(letter, id,
          " " + std::string(name) + "=\"" + std::to_string(of) + "\" NUMPOINTS=\"" + std::to_string(nodes.size()) +
              "\" TYPE=\"" + type + "\"");
    for (std::size_t k = 0; k < nodes.size(); ++k) {
      if (k > 0) out_.text("  ");
      point(at(mesh_, nodes[k]));
    }
    end_entry(letter);
  }

  /// A list of edges, one of faces, and one set of points for both.
  void packed_curves() {
    constexpr std::int64_t kEvenlySpaced = 17, kEvenlySpacedTriangle = 24;  // in Nektar++'s PointsType
    Packed lists[2], index, points;
    std::int64_t first = 0;
    const auto add = [&](Packed& list, std::int64_t id, std::int64_t of, std::int64_t type,
                         const std::vector<std::int32_t>& nodes) {
      for (const std::int64_t value : {id, of, std::int64_t(nodes.size()), std::int64_t(0), first, type})
        list.add(value);
      for (const std::int32_t node : nodes) {
        index.add(first);
        points.add(first++);
        points.add(at(mesh_, node));
      }
    };
    std::int64_t edges = 0, faces = 0;
    for_each_curved_edge([&](std::int64_t edge, const std::vector<std::int32_t>& nodes) {
      add(lists[0], edges++, edge, kEvenlySpaced, nodes);
    });
    for_each_curved_face([&](Shape shape, std::int64_t face, const std::vector<std::int32_t>& nodes) {
      add(lists[1], faces++, face, shape == Shape::Triangle ? kEvenlySpacedTriangle : kEvenlySpaced, nodes);
    });
    open("CURVED", true);
    const auto write = [&](const char* name, Packed& packed) {
      out_.text("            <" + std::string(name) + ">");
      packed.write(out_);
      out_.text("</" + std::string(name) + ">\n");
    };
    if (edges > 0) write("E", lists[0]);
    if (faces > 0) write("F", lists[1]);
    out_.text("            <DATAPOINTS ID=\"0\">\n");
    write("INDEX", index);
    write("POINTS", points);
    out_.text("            </DATAPOINTS>\n");
    close("CURVED", false);
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
      if (section.format == "nektar" && section.name == kNektarDomain) {
        out_.text("        ");
        out_.text(section.bytes);
        out_.text("\n");
        return;
      }
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
  const bool compressed_;
  BufferedOutput& out_;
};

}  // namespace

Expected<void> write_nektar(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField>,
                            const Team& team) {
  if (mesh.dimension < 2) return bad_option("VariMesh writes Nektar++'s meshes of dimension 2 and 3 only; write vtu.");
  auto vertices = nektar_vertices(mesh);
  if (!vertices) return tl::unexpected(vertices.error());
  const NektarGrid grid(mesh, std::move(*vertices));
  BufferedOutput out(sink, false, team);
  const bool as_text = std::any_of(mesh.foreign.begin(), mesh.foreign.end(), [](const ForeignSection& section) {
    return section.format == "nektar" && section.name == kNektarText;
  });
  Writer(grid, !as_text, out).write();
  return out.finish();
}

}  // namespace varimesh::formats
