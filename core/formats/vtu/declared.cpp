#include "core/formats/vtu/declared.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <string>

#include "core/base/io/scanner.h"
#include "core/base/io/text.h"
#include "core/formats/xml/xml.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats {

namespace {

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

  VtkDeclared take() {
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
    const std::string_view text = file.substr(begin, child - std::min(child, begin));
    if (!trimmed(text).empty()) list_->back().text = {begin, text.size()};
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

  VtkDeclared found_;
  std::vector<std::string> path_;
  std::vector<VtkArray>* list_ = nullptr;
  std::size_t at_ = 0;
  bool has_child_ = false;  // the array that is being read
};

}  // namespace

VtkDeclared vtk_declared(std::string_view file, const FileAllowance& allowance) {
  Parser parser(file);
  walk_xml(file, parser, allowance);
  return parser.take();
}

}  // namespace varimesh::formats
