// Reads the lists of a Nektar++ file, as text or compressed.
#include <algorithm>
#include <charconv>
#include <cstring>
#include <limits>
#include <optional>

#include "core/base/io/scanner.h"
#include "core/formats/nektar/file.h"

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

  bool has_raw_text() const override { return in_geometry() && path_.size() >= 3 && compressed_; }

  void ends(std::string_view name, XmlText text) override {
    if (path_.size() == 2 && !in_geometry()) keep(begin_.back(), text.begin + text.length);
    if (in_geometry() && path_.size() >= 3) content(name, text);
    if (in_geometry() && path_.size() == 3) trim();
    path_.pop_back();
    begin_.pop_back();
  }

  NektarFile take(const Team& team) {
    if (file_.dimension == 0) Scanner(file_.bytes).fail("it has no GEOMETRY");
    unpack_nektar_lists(file_, lists_, allowance_, team);
    finish(file_.vertex_ids, "vertex");
    finish(file_.edge_ids, "edge");
    finish(file_.faces.ids, "face");
    sort_parts(file_.elements);
    finish(file_.elements.ids, "element");
    check_nektar_points(file_, keeps_points_);
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
      points_ =
          std::int32_t(std::min<std::int64_t>(number(element, "NUMPOINTS"), std::numeric_limits<std::int32_t>::max()));
      curve_.points = nektar_points_of(scanner(begin_.back(), 0), curve_.id, element.get("TYPE"));
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
      packed(NektarPackedList::Kind::Vertices, text);
    } else if (path_.size() == 4) {
      Scanner scan = scanner(text.begin, text.length);
      allowance_.take(1, 32);
      file_.vertex_ids.add(id_);
      const auto name = [&] { return "vertex " + std::to_string(id_); };
      for (int k = 0; k < 3; ++k)
        file_.vertices.push_back(scan.finite(scan.text_number("a vertex's coordinate"), name));
      expect_end(scan);
    }
  }

  void edges(XmlText text) {
    if (compressed_ && path_.size() == 3) {
      packed(NektarPackedList::Kind::Edges, text);
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
    if (compressed_) {
      const bool faces = &list == &file_.faces;
      return packed(faces ? NektarPackedList::Kind::Faces : NektarPackedList::Kind::Elements, text, *shape);
    }
    Scanner scan = scanner(text.begin, text.length);
    allowance_.take(1, 9 + 8 * sides);
    list.ids.add(id_);
    list.shapes.push_back(*shape);
    for (std::size_t k = 0; k < sides; ++k) list.sides.push_back(small(scan.text_integer("the number of a side")));
    expect_end(scan);
  }

  void curve(std::string_view name, XmlText text) {
    if (path_.size() != 4) return;
    if (name != "E" && name != "F") fail("only E and F can be curved");
    Scanner scan = scanner(text.begin, text.length);
    if (points_ > std::int64_t(text.length)) scan.fail("NUMPOINTS is larger than the number of points");
    curve_.count = nektar_count_of(scan, points_);
    if (!keeps_points_) {
      if (text.length > std::numeric_limits<std::uint32_t>::max()) scan.fail("a curve has too many points");
      allowance_.take(2, sizeof(NektarCurve) + sizeof(NektarCurveText));
      (name == "E" ? file_.edge_texts : file_.face_texts).push_back({text.begin, std::uint32_t(text.length), points_});
      (name == "E" ? file_.curved_edges : file_.curved_faces).push_back(curve_);
      return;
    }
    allowance_.take(1, sizeof(NektarCurve) + 24 * std::size_t(points_));
    curve_.first = std::uint32_t(small(std::int64_t(file_.points.size() / 3)));
    for (std::int64_t k = 0; k < 3 * points_; ++k)
      file_.points.push_back(scan.finite(scan.text_number("a coordinate of a curve"), nektar_curve_point));
    expect_end(scan);
    (name == "E" ? file_.curved_edges : file_.curved_faces).push_back(curve_);
  }

  /// In compressed files: E and F describe the curves, DATAPOINTS has INDEX and POINTS.
  void packed_curves(std::string_view name, XmlText text) {
    if (path_.size() == 4 && name == "E")
      packed(NektarPackedList::Kind::CurvedEdges, text);
    else if (path_.size() == 4 && name == "F")
      packed(NektarPackedList::Kind::CurvedFaces, text);
    else if (path_.size() == 5 && name == "INDEX")
      packed(NektarPackedList::Kind::Index, text);
    else if (path_.size() == 5 && name == "POINTS")
      packed(NektarPackedList::Kind::Points, text);
  }

  /// Lists are unpacked when all are known.
  void packed(NektarPackedList::Kind kind, XmlText text, Shape shape = Shape::Point) {
    allowance_.take(1, sizeof(NektarPackedList));
    if (kind == NektarPackedList::Kind::Points && !keeps_points_)
      file_.points_text.push_back(text);
    else
      lists_.push_back({kind, shape, text});
  }

  /// Gives the room back into which the lists of text of a section have grown by doubling.
  void trim() {
    const auto shrink = [](auto&... lists) { (lists.shrink_to_fit(), ...); };
    shrink(file_.vertices, file_.edges, file_.faces.shapes, file_.faces.sides, file_.elements.shapes,
           file_.elements.sides, file_.curved_edges, file_.curved_faces, file_.edge_texts, file_.face_texts);
  }

  void composite(XmlText text) { file_.composites.push_back({id_, std::string(name_), text}); }

  // === Helpers ===========================================================================================

  void expect_end(Scanner& scan) const {
    scan.skip_space();
    if (!scan.at_end()) scan.fail("more numbers follow than the element has");
  }

  std::int32_t small(std::int64_t number) const {
    if (!is_nektar_number(number)) fail_nektar_number(scanner(begin_.back(), 0), number);
    return std::int32_t(number);
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

  const bool keeps_points_;
  NektarFile file_;
  FileAllowance& allowance_;
  std::vector<NektarPackedList> lists_;
  std::vector<std::string> path_;
  std::vector<std::size_t> begin_;  // where the elements of the path begin
  bool compressed_ = false;         // the section or element that is being read
  std::int64_t id_ = 0;
  std::string name_;
  NektarCurve curve_;
  std::int32_t points_ = 0;  // of the curve
};

}  // namespace

NektarFile parse_nektar(std::string_view bytes, bool keeps_points, FileAllowance& allowance, const Team& team) {
  Parser parser(bytes, keeps_points, allowance);
  walk_xml(bytes, parser, allowance);
  return parser.take(team);
}

}  // namespace varimesh::formats
