// Finds where in a binary MSH 4.1 file the blocks of nodes and elements are.
#include <algorithm>
#include <array>
#include <cstring>

#include "core/base/io/scanner.h"
#include "core/formats/gmsh/parted_file.h"

namespace varimesh::formats {
namespace {

constexpr std::size_t kNumber = sizeof(std::int64_t), kPlace = 3 * sizeof(double);

[[noreturn]] void fail(const std::string& what, const std::string& section, std::int64_t at) {
  throw ReadFailure{"The mesh file cannot be read: " + what + " (in $" + section + ", byte " + std::to_string(at) +
                    ")."};
}

[[noreturn]] void fail_format(const std::string& what) {
  throw ReadFailure{"The mesh file cannot be read in parts: " + what + "."};
}

}  // namespace

/// A cursor over the heads of sections and blocks.
class PartedFile::Heads {
 public:
  Heads(PartedFile& file) : file_(file) {}

  void read() {
    read_format();
    bool has_nodes = false, has_elements = false;
    for (std::string name = section(); !name.empty(); name = section()) {
      if (name == "Nodes" && !has_nodes) {
        has_nodes = true;
        read_nodes();
      } else if (name == "Elements" && !has_elements) {
        has_elements = true;
        read_elements();
      }
      skip_to_end(name);
    }
    if (!has_nodes || !has_elements)
      throw ReadFailure{"The mesh file ends at byte " + std::to_string(file_.size_) + ", where $" +
                        (has_nodes ? "Elements" : "Nodes") +
                        " should follow: it is incomplete, so write or copy it again."};
  }

 private:
  /// As many bytes as a line or a head may have, fewer at the end of the file.
  std::string_view window() {
    const auto count = std::min<std::int64_t>(window_.size(), file_.size_ - at_);
    file_.read_bytes(at_, window_.data(), std::size_t(count));
    return {window_.data(), std::size_t(count)};
  }

  std::string line() {
    const std::string_view bytes = window();
    const std::size_t end = std::min(bytes.find('\n'), bytes.size());
    at_ += std::min<std::int64_t>(std::int64_t(end) + 1, std::int64_t(bytes.size()));
    std::string text(bytes.substr(0, end));
    if (!text.empty() && text.back() == '\r') text.pop_back();
    return text;
  }

  template <class T>
  T next(const char* what) {
    if (file_.size_ - at_ < std::int64_t(sizeof(T))) truncated(what);
    T value;
    file_.read_bytes(at_, &value, sizeof value);
    at_ += sizeof value;
    return value;
  }

  std::int64_t count(const char* what, std::size_t least) {
    const auto value = next<std::uint64_t>(what);
    if (value > std::uint64_t(file_.size_ - at_) / least)
      fail(std::string(what) + " is more than the file has bytes for", section_, at_);
    return std::int64_t(value);
  }

  [[noreturn]] void truncated(const char* what) {
    throw ReadFailure{"The mesh file ends at byte " + std::to_string(file_.size_) + " inside $" + section_ +
                      ", where " + what + " should follow: it is incomplete, so write or copy it again."};
  }

  void read_format() {
    const std::string name = line(), version = line();
    if (name != "$MeshFormat" || version.substr(0, 5) != "4.1 1")
      fail_format(
          "With several processes, the mesh must be a binary file of Gmsh's MSH 4.1; convert it to that format first");
    section_ = "MeshFormat";
    if (next<std::int32_t>("the number 1, which shows the byte order,") != 1)
      fail("the number that shows the byte order is not 1", "MeshFormat", at_);
    skip_to_end(section_);
  }

  /// The name of the next section; empty at the end of the file.
  std::string section() {
    while (at_ < file_.size_) {
      const std::string text = line();
      if (text.find_first_not_of(" \t\r") == std::string::npos) continue;
      if (text[0] != '$') fail("the first line of a section ($...) was expected", section_, at_);
      return section_ = text.substr(1);
    }
    return {};
  }

  /// Goes behind the line $EndNAME.
  void skip_to_end(const std::string& name) {
    const std::string end = "$End" + name;
    const bool is_list = name == "Nodes" || name == "Elements";
    while (at_ < file_.size_) {
      const std::string_view bytes = window();
      const std::size_t found = bytes.find(end);
      if (found != std::string_view::npos && !(is_list && found > 2)) {
        at_ += std::int64_t(found);
        (void)line();
        return;
      }
      if (is_list)
        fail("$End" + name + " was expected: the section does not contain as many entries as it announces", section_,
             at_);
      if (bytes.size() <= end.size()) break;
      at_ += std::int64_t(bytes.size() - end.size());
    }
    truncated(end.c_str());
  }

  void read_nodes() {
    const std::int64_t blocks = count("the number of node blocks", 8);
    file_.nodes_ = count("the number of nodes", 8);
    at_ += 2 * std::int64_t(kNumber);
    std::int64_t found = 0;
    for (std::int64_t b = 0; b < blocks; ++b) {
      NodeRecords block;
      block.dimension = next<std::int32_t>("a node block's dimension");
      block.entity = next<std::int32_t>("a node block's entity");
      const auto parametric = next<std::int32_t>("a node block's parametric flag");
      if (block.dimension < 0 || block.dimension > 3) fail("a node block's dimension must be 0 to 3", "Nodes", at_);
      block.stride = kPlace + (parametric != 0 ? std::size_t(block.dimension) * sizeof(double) : 0);
      block.count = count("a node block's number of nodes", kNumber + block.stride);
      block.first = found;
      block.numbers = at_;
      block.coordinates = at_ + block.count * std::int64_t(kNumber);
      at_ = block.coordinates + block.count * std::int64_t(block.stride);
      found += block.count;
      if (found > file_.nodes_) fail("the node blocks have more nodes than announced", "Nodes", at_);
      if (block.count > 0) file_.node_records_.push_back(block);
    }
    if (found != file_.nodes_) fail("the node blocks have fewer nodes than announced", "Nodes", at_);
  }

  void read_elements() {
    const std::int64_t blocks = count("the number of element blocks", 8);
    const std::int64_t total = count("the number of elements", 8);
    at_ += 2 * std::int64_t(kNumber);
    std::array<std::int64_t, 4> found{};
    for (std::int64_t b = 0; b < blocks; ++b) {
      ElementRecords block;
      block.dimension = next<std::int32_t>("an element block's dimension");
      block.entity = next<std::int32_t>("an element block's entity");
      block.type = next<std::int32_t>("an element block's type");
      const GmshType type = gmsh_type(block.type);
      if (node_count(type) == 0) fail(why_refused(block.type), "Elements", at_);
      if (type.kind != GmshType::Kind::Complete)
        fail_format(
            "Several processes read no incomplete (serendipity) elements; convert the mesh to complete ones first");
      if (block.dimension != reference::info(type.shape).dimension)
        fail("an element block of dimension " + std::to_string(block.dimension) + " contains " +
                 std::string(reference::info(type.shape).plural),
             "Elements", at_);
      block.stride = kNumber * (1 + std::size_t(node_count(type)));
      block.count = count("an element block's number of elements", block.stride);
      block.first = found[std::size_t(block.dimension)];
      block.at = at_;
      at_ += block.count * std::int64_t(block.stride);
      found[std::size_t(block.dimension)] += block.count;
      if (block.count == 0) continue;
      file_.element_records_.push_back(block);
      file_.dimension_ = std::max(file_.dimension_, int(block.dimension));
    }
    if (found[0] + found[1] + found[2] + found[3] != total)
      fail("the element blocks do not have as many elements as announced", "Elements", at_);
  }

  PartedFile& file_;
  std::int64_t at_ = 0;
  std::string section_;
  std::string window_ = std::string(1 << 16, '\0');
};

void PartedFile::find_records() { Heads(*this).read(); }

}  // namespace varimesh::formats
