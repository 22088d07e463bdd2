// Reads the lists of a Nektar++ file, as text or compressed.
#include <algorithm>
#include <charconv>
#include <cstring>
#include <limits>
#include <optional>

#include "core/formats/nektar/file.h"
#include "core/formats/scanner.h"

namespace varimesh::formats {

namespace {

constexpr std::string_view kCompressed = "B64Z-LittleEndian";

std::optional<Shape> shape_of(std::string_view letter) {
  for (const Shape shape :
       {Shape::Triangle, Shape::Quadrilateral, Shape::Tetrahedron, Shape::Pyramid, Shape::Prism, Shape::Hexahedron})
    if (letter.size() == 1 && letter[0] == nektar_letter(shape)) return shape;
  return std::nullopt;
}

class Parser : public XmlVisitor {
 public:
  Parser(std::string_view bytes, bool keeps_points, FileAllowance& allowance)
      : keeps_points_(keeps_points), allowance_(allowance) {
    file_.bytes = bytes;
  }

  bool begins(const XmlElement& element) override {
    path_.emplace_back(element.name);
    begin_.push_back(element.begin);
    if (path_.size() == 2 && path_[1] == "GEOMETRY") geometry(element);
    if (!in_geometry()) return true;
    if (path_.size() == 3) section(element);
    if (path_.size() == 4) item(element);
    return true;
  }

  void ends(std::string_view name, XmlText text) override {
    if (path_.size() == 2 && !in_geometry()) keep(begin_.back(), text.begin + text.length);
    if (in_geometry() && path_.size() >= 3) content(name, text);
    path_.pop_back();
    begin_.pop_back();
  }

  NektarFile take() {
    if (file_.dimension == 0) Scanner(file_.bytes).fail("it has no GEOMETRY");
    finish(file_.vertex_ids, "vertex");
    finish(file_.edge_ids, "edge");
    finish(file_.faces.ids, "face");
    sort_parts(file_.elements);
    finish(file_.elements.ids, "element");
    for (std::vector<NektarCurve>* curves : {&file_.curved_edges, &file_.curved_faces}) check_points(*curves);
    return std::move(file_);
  }

 private:
  bool in_geometry() const { return path_.size() >= 2 && path_[0] == "NEKTAR" && path_[1] == "GEOMETRY"; }

  /// A scanner of some bytes that names places of the file.
  Scanner scanner(std::size_t begin, std::size_t length) const {
    Scanner scan(file_.bytes.substr(0, begin + length));
    scan.go_to(begin);
    return scan;
  }
  [[noreturn]] void fail(const std::string& what) const { scanner(begin_.back(), 0).fail(what); }

  void geometry(const XmlElement& element) {
    if (file_.dimension != 0) fail("it has more than one GEOMETRY");
    if (element.find("HDF5FILE") != nullptr)
      fail("the mesh is in a file of its own, " + std::string(element.get("HDF5FILE")) +
           "; bring both into one XML file with: NekMesh FILE out.xml");
    file_.dimension = int(number(element, "DIM"));
    if (file_.dimension != 2 && file_.dimension != 3)
      fail("the mesh has dimension " + std::to_string(file_.dimension) + "; VariMesh takes dimensions 2 and 3");
  }

  void section(const XmlElement& element) {
    for (const char* change : {"XSCALE", "YSCALE", "ZSCALE", "XMOVE", "YMOVE", "ZMOVE", "ZROT"})
      if (element.find(change) != nullptr)
        fail("the attribute " + std::string(change) + " changes the coordinates; let NekMesh write the changed mesh");
    compressed_ = is_compressed(element);
    file_.compressed = file_.compressed || compressed_;
  }

  bool is_compressed(const XmlElement& element) const {
    const std::string_view* value = element.find("COMPRESSED");
    if (value == nullptr) return false;
    if (*value != kCompressed || (element.find("BITSIZE") != nullptr && element.get("BITSIZE") != "64"))
      fail("the compression is not " + std::string(kCompressed) + " with 64 bits");
    return true;
  }

  /// An element inside a section: remembers its attributes until its text is there.
  void item(const XmlElement& element) {
    if (path_[2] == "FACE" || path_[2] == "ELEMENT") {
      compressed_ = is_compressed(element);
      file_.compressed = file_.compressed || compressed_;
    }
    const bool has_id = !compressed_ && path_[2] != kNektarDomain;
    id_ = has_id ? number(element, "ID") : 0;
    if (path_[2] == "COMPOSITE") name_ = element.get("NAME");
    if (path_[2] == "CURVED" && !compressed_) {
      curve_ = {};
      curve_.id = small(number(element, path_[3] == "E" ? "EDGEID" : "FACEID"));
      // More than the text can have are refused when it is there.
      curve_.count =
          std::int32_t(std::min<std::int64_t>(number(element, "NUMPOINTS"), std::numeric_limits<std::int32_t>::max()));
      set_points(curve_, element.get("TYPE"));
    }
  }

  std::int64_t number(const XmlElement& element, const char* attribute) const {
    const std::string_view* value = element.find(attribute);
    if (value == nullptr) fail("the attribute " + std::string(attribute) + " is missing");
    std::int64_t result = 0;
    const auto [stop, error] = std::from_chars(value->data(), value->data() + value->size(), result);
    if (error != std::errc() || stop != value->data() + value->size() || result < 0)
      fail("the attribute " + std::string(attribute) + " is not a number from 0 on");
    return result;
  }

  void set_points(NektarCurve& curve, std::string_view name) const {
    const auto points = points_of(name);
    if (!points)
      fail("the curve of " + std::to_string(curve.id) + " has points of the type '" + std::string(name.substr(0, 40)) +
           "'; VariMesh reads PolyEvenlySpaced, GaussLobattoLegendre and NodalTriEvenlySpaced");
    curve.points = *points;
  }

  // === What the sections contain =========================================================================

  void content(std::string_view name, XmlText text) {
    const std::string& section = path_[2];
    if (section == "VERTEX")
      vertices(text);
    else if (section == "EDGE")
      edges(text);
    else if (section == "FACE" && path_.size() == 4)
      parts(file_.faces, 2, name, text);
    else if (section == "ELEMENT" && path_.size() == 4)
      parts(file_.elements, file_.dimension, name, text);
    else if (section == "CURVED")
      compressed_ ? packed_curves(name, text) : curve(name, text);
    else if (section == "COMPOSITE" && path_.size() == 4)
      composite(text);
    else if (section == kNektarDomain && path_.size() == 3)
      keep(begin_.back(), text.begin + text.length);
  }

  void vertices(XmlText text) {
    if (compressed_ && path_.size() == 3) {
      struct Vertex {
        std::int64_t id;
        double x[3];
      };
      const auto reserve = [&](std::size_t count) {
        allowance_.take(count, kIdBytes);
        make_room(file_.vertices, 3 * count);
      };
      for_each_packed<Vertex>(text, reserve, [&](const Vertex& vertex) {
        file_.vertex_ids.add(vertex.id);
        file_.vertices.insert(file_.vertices.end(), vertex.x, vertex.x + 3);
      });
    } else if (path_.size() == 4) {
      Scanner scan = scanner(text.begin, text.length);
      allowance_.take(1, 32);
      file_.vertex_ids.add(id_);
      for (int k = 0; k < 3; ++k) file_.vertices.push_back(scan.text_number("a vertex's coordinate"));
      expect_end(scan);
    }
  }

  void edges(XmlText text) {
    if (compressed_ && path_.size() == 3) {
      struct Edge {
        std::int64_t id, vertices[2];
      };
      const auto reserve = [&](std::size_t count) {
        allowance_.take(count, kIdBytes);
        make_room(file_.edges, 2 * count);
      };
      for_each_packed<Edge>(text, reserve, [&](const Edge& edge) {
        file_.edge_ids.add(edge.id);
        for (const std::int64_t vertex : edge.vertices) file_.edges.push_back(small(vertex));
      });
    } else if (path_.size() == 4) {
      Scanner scan = scanner(text.begin, text.length);
      allowance_.take(1, 24);
      file_.edge_ids.add(id_);
      for (int k = 0; k < 2; ++k) file_.edges.push_back(small(scan.text_integer("an edge's vertex")));
      expect_end(scan);
    }
  }

  void parts(NektarParts& list, int dimension, std::string_view letter, XmlText text) {
    const auto shape = shape_of(letter);
    if (!shape || reference::info(*shape).dimension != dimension)
      fail("'" + std::string(letter.substr(0, 20)) + "' is no shape of dimension " + std::to_string(dimension));
    const auto sides = std::size_t(nektar_sides(*shape));
    const auto add = [&](std::int64_t id) {
      list.ids.add(id);
      list.shapes.push_back(*shape);
    };
    if (!compressed_) {
      Scanner scan = scanner(text.begin, text.length);
      allowance_.take(1, 9 + 8 * sides);
      add(id_);
      for (std::size_t k = 0; k < sides; ++k) list.sides.push_back(small(scan.text_integer("the number of a side")));
      return expect_end(scan);
    }
    unpack_nektar(file_.bytes, text, 8 * (1 + sides), allowance_, [&](std::string_view bytes) {
      const std::size_t count = bytes.size() / (8 * (1 + sides));
      allowance_.take(count, kIdBytes);
      make_room(list.shapes, count);
      make_room(list.sides, count * sides);
      for (std::size_t at = 0; at < bytes.size(); at += 8 * (1 + sides)) {
        std::array<std::int64_t, 7> numbers{};
        std::memcpy(numbers.data(), bytes.data() + at, 8 * (1 + sides));
        add(numbers[0]);
        for (std::size_t k = 1; k <= sides; ++k) list.sides.push_back(small(numbers[k]));
      }
    });
  }

  void curve(std::string_view name, XmlText text) {
    if (path_.size() != 4) return;
    if (name != "E" && name != "F") fail("only E and F can be curved");
    Scanner scan = scanner(text.begin, text.length);
    if (curve_.count > std::int64_t(text.length)) scan.fail("NUMPOINTS is larger than the number of points");
    if (!keeps_points_) {
      if (text.length > std::numeric_limits<std::uint32_t>::max()) scan.fail("a curve has too many points");
      allowance_.take(2, sizeof(NektarCurve) + sizeof(NektarCurveText));
      (name == "E" ? file_.edge_texts : file_.face_texts)
          .push_back({text.begin, std::uint32_t(text.length), curve_.count});
      (name == "E" ? file_.curved_edges : file_.curved_faces).push_back(curve_);
      return;
    }
    allowance_.take(1, sizeof(NektarCurve) + 24 * std::size_t(curve_.count));
    curve_.first = std::uint32_t(small(std::int64_t(file_.points.size() / 3)));
    for (std::int64_t k = 0; k < 3 * curve_.count; ++k)
      file_.points.push_back(scan.text_number("a coordinate of a curve"));
    expect_end(scan);
    (name == "E" ? file_.curved_edges : file_.curved_faces).push_back(curve_);
  }

  /// In compressed files: E and F describe the curves, DATAPOINTS has INDEX and POINTS.
  void packed_curves(std::string_view name, XmlText text) {
    if (path_.size() == 4 && (name == "E" || name == "F")) {
      struct Info {
        std::int64_t id, of, count, points, first, type;
      };
      std::vector<NektarCurve>& curves = name == "E" ? file_.curved_edges : file_.curved_faces;
      const auto reserve = [&](std::size_t count) { make_room(curves, count); };
      for_each_packed<Info>(text, reserve, [&](const Info& info) {
        if (info.count < 0 || info.first < 0) fail("a curve has a negative number of points");
        NektarCurve made{small(info.of), small(info.count), std::uint32_t(small(info.first)), {}};
        in_curves_ += std::size_t(info.count);
        set_points(made, name_of_points(info.type));
        curves.push_back(made);
      });
    } else if (path_.size() == 5 && name == "INDEX") {
      for_each_packed<std::int64_t>(
          text, [](std::size_t) {}, [&](std::int64_t number) { add_index(number, text.length); });
    } else if (path_.size() == 5 && name == "POINTS" && !keeps_points_) {
      allowance_.take(1, sizeof(XmlText));
      file_.points_text.push_back(text);
    } else if (path_.size() == 5 && name == "POINTS") {
      // Mostly there are as many as the curves have, and a point takes many bytes of the file.
      if (in_curves_ < text.length) make_room(file_.points, 3 * in_curves_);
      const auto reserve = [&](std::size_t count) { make_room(file_.points, 3 * count); };
      for_each_packed<NektarPackedPoint>(text, reserve, [&](const NektarPackedPoint& point) {
        file_.points.insert(file_.points.end(), point.x, point.x + 3);
      });
    }
  }

  void composite(XmlText text) { file_.composites.push_back({id_, std::string(name_), text}); }

  // === Helpers ===========================================================================================

  void expect_end(Scanner& scan) const {
    scan.skip_space();
    if (!scan.at_end()) scan.fail("more numbers follow than the element has");
  }

  /// Numbers of entries; a file cannot have more than fit into 32 bits.
  std::int32_t small(std::int64_t number) const {
    if (number < 0 || number > std::numeric_limits<std::int32_t>::max())
      fail("the number " + std::to_string(number) + " of a vertex, edge, face, element or point is not from 0 to " +
           std::to_string(std::numeric_limits<std::int32_t>::max()));
    return std::int32_t(number);
  }

  void add_index(std::int64_t number, std::size_t length) {
    if (file_.index.empty() && number == std::int64_t(indices_)) {
      ++indices_;
      return;
    }
    if (file_.index.empty()) {
      make_room(file_.index, std::max(indices_ + 1, in_curves_ < length ? in_curves_ : 0));
      for (std::size_t i = 0; i < indices_; ++i) file_.index.push_back(std::int32_t(i));
    }
    make_room(file_.index, 1);
    file_.index.push_back(small(number));
    ++indices_;
  }

  /// `reserve(count)` makes room in the lists for the records of a piece.
  template <class Record, class Reserve, class Body>
  void for_each_packed(XmlText text, const Reserve& reserve, const Body& body) {
    unpack_nektar(file_.bytes, text, sizeof(Record), allowance_, [&](std::string_view bytes) {
      reserve(bytes.size() / sizeof(Record));
      for (std::size_t at = 0; at < bytes.size(); at += sizeof(Record)) {
        allowance_.look();
        Record record;
        std::memcpy(&record, bytes.data() + at, sizeof(Record));
        body(record);
      }
    });
  }

  /// Makes room for `more` values. While the list grows, it is in memory twice.
  template <class T>
  void make_room(std::vector<T>& values, std::size_t more) {
    const std::size_t before = values.capacity(), size = values.size() + more;
    if (size <= before) return;
    const std::size_t wanted = std::max(size, before + before / 2);
    allowance_.take(wanted, sizeof(T));
    values.reserve(wanted);
    allowance_.give_back(before * sizeof(T));
  }

  /// Keeps an element with its tags, from its first byte to its end tag.
  void keep(std::size_t begin, std::size_t end_tag) {
    const std::size_t close = file_.bytes.find('>', end_tag);
    const std::size_t end = close == std::string_view::npos ? file_.bytes.size() : close + 1;
    allowance_.take(1, end - begin);
    file_.others.push_back({path_.back(), std::string(file_.bytes.substr(begin, end - begin)), "nektar"});
  }

  void finish(NektarIds& ids, const char* what) {
    std::int64_t twice = 0;
    if (!ids.are_consecutive()) allowance_.take(ids.size(), NektarIds::kSortedBytes);
    if (!ids.finish(twice))
      Scanner(file_.bytes).fail("the " + std::string(what) + " " + std::to_string(twice) + " occurs twice");
  }

  /// The points of every curve must be in the index and, if they are kept, there.
  void check_points(const std::vector<NektarCurve>& curves) const {
    const Scanner scan(file_.bytes);
    // Points that are not kept are counted when they are read.
    const std::size_t points = keeps_points_ ? file_.points.size() / 3 : std::numeric_limits<std::int32_t>::max();
    const std::size_t most = indices_ == 0 ? points : file_.index.empty() ? std::min(points, indices_) : indices_;
    for (const NektarCurve& curve : curves)
      if (std::size_t(curve.count) > most || curve.first > most - std::size_t(curve.count))
        scan.fail("the curve of " + std::to_string(curve.id) + " has points that are not in the file");
    for (const std::int32_t number : file_.index)
      if (std::size_t(number) >= points)
        scan.fail("a curve refers to point " + std::to_string(number) + ", but there are " + std::to_string(points));
  }

  static constexpr std::size_t kIdBytes = sizeof(std::int64_t);

  const bool keeps_points_;
  NektarFile file_;
  FileAllowance& allowance_;
  std::size_t in_curves_ = 0;  // points of all curves of a compressed file
  std::size_t indices_ = 0;    // numbers in its INDEX
  std::vector<std::string> path_;
  std::vector<std::size_t> begin_;  // where the elements of the path begin
  bool compressed_ = false;         // the section or element that is being read
  std::int64_t id_ = 0;
  std::string name_;
  NektarCurve curve_;
};

}  // namespace

NektarFile parse_nektar(std::string_view bytes, bool keeps_points, FileAllowance& allowance) {
  Parser parser(bytes, keeps_points, allowance);
  walk_xml(bytes, parser);
  return parser.take();
}

}  // namespace varimesh::formats
