#include "core/formats/vtu/read.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <charconv>
#include <cmath>
#include <map>
#include <set>

#include "core/formats/format_table.h"
#include "core/formats/scanner.h"
#include "core/formats/vtu.h"
#include "core/formats/vtu/arrays.h"
#include "core/formats/vtu/cells.h"
#include "core/formats/xml/xml.h"

namespace varimesh::formats {

namespace {

/// The file's declarations: everything but the values.
struct Declared {
  VtkEncoding encoding;
  int version = 0;  ///< Ten times the version: 21 is 2.1.
  std::int64_t points = -1, cells = -1;
  std::vector<VtkArray> coordinates, topology, cell_data, field_data;
};

class Parser : public XmlVisitor {
 public:
  explicit Parser(std::string_view bytes) { found_.encoding.file = bytes; }

  bool begins(const XmlElement& element) override {
    if (!path_.empty() && path_.back() == "DataArray") end_text(element.begin);
    at_ = element.begin;
    path_.emplace_back(element.name);
    if (element.name == "VTKFile") file(element);
    if (element.name == "Piece") piece(element);
    if (element.name == "DataArray") array(element);
    if (element.name != "AppendedData") return true;
    appended(element);
    return false;  // raw bytes are no XML
  }

  void ends(std::string_view name, XmlText text) override {
    if (name == "DataArray" && list_ != nullptr && list_->back().text.length == 0) list_->back().text = text;
    path_.pop_back();
  }

  Declared take() {
    if (found_.points < 0) Scanner(found_.encoding.file).fail("it has no Piece");
    return std::move(found_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    Scanner scan(found_.encoding.file);
    scan.go_to(at_);
    scan.fail(what);
  }

  void file(const XmlElement& element) {
    if (element.get("type") != "UnstructuredGrid")
      fail("it has the type '" + std::string(element.get("type").substr(0, 40)) +
           "'; VariMesh reads UnstructuredGrid (.vtu), which ParaView and meshio write");
    const std::string_view version = element.get("version");
    if (version.size() == 3 && version[1] == '.') found_.version = 10 * (version[0] - '0') + (version[2] - '0');
    constexpr bool kLittle = std::endian::native == std::endian::little;
    found_.encoding.swapped = (element.get("byte_order") == "BigEndian") == kLittle;
    found_.encoding.wide_headers = element.get("header_type") == "UInt64";
    const std::string_view compressor = element.get("compressor");
    if (!compressor.empty() && compressor != "vtkZLibDataCompressor")
      fail("it is compressed with " + std::string(compressor.substr(0, 40)) + "; VariMesh reads vtkZLibDataCompressor");
    found_.encoding.compressed = !compressor.empty();
  }

  void piece(const XmlElement& element) {
    if (found_.points >= 0) fail("it has several pieces; join them, for example with ParaView's filter Merge Blocks");
    found_.points = number(element, "NumberOfPoints", kMostNodes);
    found_.cells = number(element, "NumberOfCells", kMostNodes);
  }

  std::int64_t number(const XmlElement& element, const char* attribute, std::int64_t most) const {
    const std::string_view text = element.get(attribute);
    std::int64_t value = 0;
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || error != std::errc() || stop != text.data() + text.size() || value < 0 || value > most)
      fail("the attribute " + std::string(attribute) + " is not a number from 0 to " + std::to_string(most));
    return value;
  }

  void array(const XmlElement& element) {
    list_ = nullptr;
    has_child_ = false;
    if (path_.size() < 2) return;
    const std::string& section = path_[path_.size() - 2];
    if (section == "Points") list_ = &found_.coordinates;
    if (section == "Cells") list_ = &found_.topology;
    if (section == "CellData") list_ = &found_.cell_data;
    if (section == "FieldData") list_ = &found_.field_data;
    if (list_ == nullptr) return;
    VtkArray made;
    made.name = element.get("Name");
    made.type = element.get("type");
    if (element.find("NumberOfComponents") != nullptr)
      made.components = int(number(element, "NumberOfComponents", 1'000'000));
    const std::string_view format = element.get("format");
    if (format == "appended") {
      made.place = VtkPlace::Appended;
      made.offset = std::size_t(number(element, "offset", std::int64_t(1) << 60));
    } else if (format == "binary") {
      made.place = VtkPlace::Inline;
    } else if (format != "ascii") {
      fail("an array has the format '" + std::string(format.substr(0, 20)) + "', not ascii, binary or appended");
    }
    list_->push_back(std::move(made));
  }

  /// VTK may write information about an array behind its values, as elements of their own.
  void end_text(std::size_t child) {
    if (list_ == nullptr || has_child_) return;
    has_child_ = true;
    const std::string_view file = found_.encoding.file;
    const std::size_t begin = file.find('>', at_) + 1;
    const auto is_space = [](char c) { return static_cast<unsigned char>(c) <= ' '; };
    const std::string_view text = file.substr(begin, child - std::min(child, begin));
    if (!std::all_of(text.begin(), text.end(), is_space)) list_->back().text = {begin, text.size()};
  }

  void appended(const XmlElement& element) {
    const std::string_view encoding = element.get("encoding");
    if (encoding != "raw" && encoding != "base64") fail("the appended data is neither raw nor base64");
    found_.encoding.raw = encoding == "raw";
    const std::string_view file = found_.encoding.file;
    const std::size_t close = file.find('>', element.begin), underscore = file.find('_', close);
    if (close == std::string_view::npos || underscore == std::string_view::npos) fail("the appended data is missing");
    found_.encoding.appended = underscore + 1;
  }

  Declared found_;
  std::vector<std::string> path_;
  std::vector<VtkArray>* list_ = nullptr;
  std::size_t at_ = 0;
  bool has_child_ = false;  // the array that is being read
};

class Reading {
 public:
  Reading(Declared declared, FileAllowance& allowance) : declared_(std::move(declared)), allowance_(allowance) {}

  HighOrderMesh take() {
    check_encoding();
    const auto points = std::size_t(declared_.points);
    if (declared_.coordinates.size() != 1 || declared_.coordinates[0].components != 3)
      fail("it has no points with three coordinates");
    mesh_.coordinates = vtk_numbers(declared_.coordinates[0], 3 * points, declared_.encoding, allowance_);
    read_cells();
    read_groups();
    make_blocks();
    drop_added_points();
    for (const ElementBlock& block : mesh_.blocks)
      mesh_.dimension = std::max(mesh_.dimension, reference::info(block.shape).dimension);
    for (const ElementBlock& block : mesh_.blocks)
      if (reference::info(block.shape).dimension == mesh_.dimension) mesh_.order = block.order;
    allowance_.take(mesh_.node_count(), sizeof(std::int64_t));
    for (std::size_t node = 0; node < mesh_.node_count(); ++node) mesh_.node_numbers.push_back(std::int64_t(node) + 1);
    mesh_.node_blocks = {{-1, 0, 0, std::int32_t(mesh_.node_count())}};
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { Scanner(declared_.encoding.file).fail(what); }

  void check_encoding() const {
    for (const auto* list : {&declared_.coordinates, &declared_.topology, &declared_.cell_data, &declared_.field_data})
      for (const VtkArray& array : *list)
        if (array.place == VtkPlace::Appended && declared_.encoding.appended == 0)
          fail("the array '" + array.name.substr(0, 40) + "' is appended, but the file has no AppendedData");
  }

  static const VtkArray* find(const std::vector<VtkArray>& list, std::string_view name) {
    const auto found =
        std::find_if(list.begin(), list.end(), [&](const VtkArray& array) { return array.name == name; });
    return found == list.end() ? nullptr : &*found;
  }

  const VtkArray& topology(const char* name) const {
    const VtkArray* array = find(declared_.topology, name);
    if (array == nullptr) fail("the cells have no array '" + std::string(name) + "'");
    return *array;
  }

  void read_cells() {
    const auto cells = std::size_t(declared_.cells);
    connectivity_ = vtk_integers(topology("connectivity"), declared_.encoding, allowance_);
    offsets_ = vtk_integers(topology("offsets"), cells, declared_.encoding, allowance_);
    types_ = vtk_integers(topology("types"), cells, declared_.encoding, allowance_);
    std::int64_t before = 0;
    for (const std::int64_t offset : offsets_) {
      if (offset < before || offset > std::int64_t(connectivity_.size()))
        fail("the offsets of the cells do not rise, or are larger than the number of their nodes");
      before = offset;
    }
    for (const std::int64_t node : connectivity_)
      if (node < 0 || node >= declared_.points)
        fail("a cell refers to point " + std::to_string(node) + ", but the points are 0 to " +
             std::to_string(declared_.points - 1));
  }

  /// The first of these arrays of whole numbers that the cells have; otherwise zeros.
  std::vector<std::int64_t> of_cells(std::initializer_list<const char*> names) {
    const auto cells = std::size_t(declared_.cells);
    for (const char* name : names) {
      const VtkArray* array = find(declared_.cell_data, name);
      if (array == nullptr || array->components > 1 || array->type.starts_with("Float")) continue;
      auto values = vtk_integers(*array, cells, declared_.encoding, allowance_);
      for (const std::int64_t value : values)
        if (value < -1'000'000'000 || value > 1'000'000'000)
          fail("the array '" + array->name + "' has the value " + std::to_string(value) + ", which is no tag");
      return values;
    }
    allowance_.take(cells, sizeof(std::int64_t));
    return std::vector<std::int64_t>(cells, 0);
  }

  void read_groups() {
    physical_ = of_cells({"gmsh:physical", "physical", "material", "attribute"});
    entities_ = of_cells({"gmsh:geometrical"});
    numbers_ = of_cells({"element"});
    std::set<std::int64_t> seen;
    bool unique = true;
    for (const std::int64_t number : numbers_) unique = unique && number > 0 && seen.insert(number).second;
    for (std::size_t cell = 0; !unique && cell < numbers_.size(); ++cell) numbers_[cell] = std::int64_t(cell) + 1;
    for (const VtkArray& array : declared_.field_data) {
      if (array.type.starts_with("Float") || array.components > 2) continue;
      const auto values = vtk_integers(array, declared_.encoding, allowance_);
      if (values.size() != 2 || values[0] < 1 || values[0] > 1'000'000'000 || values[1] < 0 || values[1] > 3) continue;
      mesh_.physical_groups.push_back({int(values[1]), int(values[0]), array.name});
    }
  }

  void make_blocks() {
    const bool new_order = declared_.version >= 21;
    std::int64_t first = 0;
    for (std::size_t cell = 0; cell < types_.size(); ++cell) {
      const std::span<const std::int64_t> nodes(connectivity_.data() + first, std::size_t(offsets_[cell] - first));
      first = offsets_[cell];
      auto kind = vtk_kind(types_[cell], nodes.size(), new_order);
      if (!kind) fail(kind.error().sentence + " (cell " + std::to_string(cell) + ", counted from 0)");
      const bool is_pyramid = kind->shape == Shape::Hexahedron && kind->order > 1 && nodes[4] == nodes[5] &&
                              nodes[5] == nodes[6] && nodes[6] == nodes[7];
      if (is_pyramid && kind->order > 2)
        fail("cell " + std::to_string(cell) + " (counted from 0) is a pyramid of order " + std::to_string(kind->order) +
             ", whose inner nodes VTK's cells do not have; give VariMesh the MSH file from which it was made");
      if (is_pyramid) {
        kind = vtk_pyramid(kind->order, new_order || types_[cell] == 29);
        check_pyramid(*kind, nodes, cell);
      }
      add(*kind, nodes, cell);
    }
  }

  void add(const VtkKind& kind, std::span<const std::int64_t> nodes, std::size_t cell) {
    std::vector<int> groups;
    if (physical_[cell] != 0) groups.push_back(int(physical_[cell]));
    const int entity = entities_[cell] != 0 ? int(entities_[cell]) : groups.empty() ? 1 : std::abs(groups[0]);
    std::vector<ElementBlock>& blocks = mesh_.blocks;
    if (blocks.empty() || blocks.back().shape != kind.shape || blocks.back().order != kind.order ||
        blocks.back().physical != groups || blocks.back().entity != entity) {
      allowance_.take(1, sizeof(ElementBlock));
      blocks.push_back({kind.shape, kind.order, entity, groups, {}, {}, {}, {}});
    }
    allowance_.take(1, sizeof(std::int64_t) + sizeof(std::int32_t) * kind.places->size());
    blocks.back().numbers.push_back(numbers_[cell]);
    for (const int place : *kind.places) blocks.back().nodes.push_back(std::int32_t(nodes[std::size_t(place)]));
  }

  /// A hexahedron that is a pyramid has points that follow from the pyramid's nodes. If they are elsewhere, it is none.
  void check_pyramid(const VtkKind& kind, std::span<const std::int64_t> nodes, std::size_t cell) {
    const Eigen::MatrixXd& added = vtk_added_points(kind.order);
    Eigen::Matrix<double, Eigen::Dynamic, 3> x(added.cols(), 3);
    double size = 0;
    for (Eigen::Index i = 0; i < x.rows(); ++i)
      for (Eigen::Index k = 0; k < 3; ++k) {
        x(i, k) =
            mesh_.coordinates[3 * std::size_t(nodes[std::size_t((*kind.places)[std::size_t(i)])]) + std::size_t(k)];
        size = std::max(size, std::abs(x(i, k) - x(0, k)));
      }
    const Eigen::Matrix<double, Eigen::Dynamic, 3> wanted = added * x;
    const VtkCell own = vtk_cell(Shape::Pyramid, kind.order);
    Eigen::Index row = 0;
    if (added_.empty()) added_.assign(mesh_.node_count(), false);
    for (std::size_t i = 0; i < own.nodes.size(); ++i) {
      if (own.nodes[i] >= 0) continue;
      const auto point = std::size_t(nodes[i]);
      for (Eigen::Index k = 0; k < 3; ++k)
        if (!(std::abs(mesh_.coordinates[3 * point + std::size_t(k)] - wanted(row, k)) <= 1e-5 * size))
          fail("cell " + std::to_string(cell) +
               " (counted from 0) is a hexahedron whose top face is a point, and no pyramid of VariMesh's");
      added_[point] = true;
      ++row;
    }
  }

  /// Removes the points that only such pyramids have.
  void drop_added_points() {
    if (added_.empty()) return;
    for (const ElementBlock& block : mesh_.blocks)
      for (const std::int32_t node : block.nodes) added_[std::size_t(node)] = false;
    std::vector<std::int32_t> place(added_.size(), -1);
    std::int32_t next = 0;
    for (std::size_t node = 0; node < added_.size(); ++node) {
      if (added_[node]) continue;
      for (std::size_t k = 0; k < 3; ++k)
        mesh_.coordinates[3 * std::size_t(next) + k] = mesh_.coordinates[3 * node + k];
      place[node] = next++;
    }
    mesh_.coordinates.resize(3 * std::size_t(next));
    for (ElementBlock& block : mesh_.blocks)
      for (std::int32_t& node : block.nodes) node = place[std::size_t(node)];
  }

  Declared declared_;
  FileAllowance& allowance_;
  HighOrderMesh mesh_;
  std::vector<std::int64_t> connectivity_, offsets_, types_, physical_, entities_, numbers_;
  std::vector<bool> added_;  // points that only the hexahedra of pyramids have; empty if there are none
};

}  // namespace

bool begins_like_vtk(std::string_view bytes) { return begins_with_element(bytes, "VTKFile"); }

Expected<MeshFile> read_vtu(std::string_view bytes, const Team& team) {
  FileAllowance allowance(bytes.size(), team.stop());
  const std::string plain = without_comments(bytes, "AppendedData");
  allowance.take(plain.size(), 1);
  if (!plain.empty()) bytes = plain;
  Parser parser(bytes);
  walk_xml(bytes, parser);
  return MeshFile{Reading(parser.take(), allowance).take(), Format::Vtu};
}

}  // namespace varimesh::formats
