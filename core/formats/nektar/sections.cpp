// Writes what stands behind the curves of a Nektar++ file: composites, the domain and all that the mesh was read with.
#include <algorithm>
#include <map>

#include "core/formats/nektar/composites.h"
#include "core/formats/nektar/grid.h"
#include "core/formats/xml/xml.h"

namespace varimesh::formats {

namespace {

/// A list as the format has it, such as F[0-3,7].
class List {
 public:
  void add(std::int64_t number) {
    if (last_ >= 0 && number == last_ + 1) {
      last_ = number;
      return;
    }
    put();
    first_ = last_ = number;
  }
  bool is_empty() const { return last_ < 0; }
  std::string text(char letter) {
    put();
    last_ = -1;
    return std::string(1, letter) + "[" + text_ + "]";
  }

 private:
  void put() {
    if (last_ < 0) return;
    if (!text_.empty()) text_ += ",";
    text_ += std::to_string(first_);
    if (last_ > first_) text_ += "-" + std::to_string(last_);
  }
  std::string text_;
  std::int64_t first_ = -1, last_ = -1;
};

class Writer {
 public:
  Writer(const NektarGrid& grid, BufferedOutput& out)
      : grid_(grid), mesh_(grid.mesh), composites_(nektar_composites(grid.mesh)), out_(out) {}

  void write() {
    composites();
    domain();
    out_.text("    </GEOMETRY>\n");
    others();
  }

 private:
  void composites() {
    std::vector<std::int64_t> first(mesh_.blocks.size(), 0);  // the number of each block's first cell
    std::int64_t next = 0;
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b)
      if (reference::info(mesh_.blocks[b].shape).dimension == mesh_.dimension) {
        first[b] = next;
        next += std::int64_t(mesh_.blocks[b].size());
      }
    out_.text("        <COMPOSITE>\n");
    for (const NektarComposites::One& one : composites_.all) {
      std::map<char, List> lists;
      for (const std::size_t b : one.blocks) add(lists, one, mesh_.blocks[b], first[b]);
      std::erase_if(lists, [](const auto& list) { return list.second.is_empty(); });
      if (lists.empty()) continue;
      out_.text("            <C ID=\"" + std::to_string(one.id) + "\"");
      if (!one.name.empty()) out_.text(" NAME=\"" + escaped_xml(one.name) + "\"");
      out_.text(">");
      for (auto& [letter, list] : lists) {
        out_.text(" ");
        out_.text(list.text(letter));
      }
      out_.text(" </C>\n");
    }
    out_.text("        </COMPOSITE>\n");
  }

  void add(std::map<char, List>& lists, const NektarComposites::One& one, const ElementBlock& block,
           std::int64_t first) const {
    const auto count = std::size_t(reference::node_count(block.shape, block.order));
    const bool cells = one.dimension == mesh_.dimension;
    List& list = lists[cells ? nektar_letter(block.shape) : one.dimension == 1 ? 'E' : 'F'];
    for (std::size_t e = 0; e < block.size(); ++e) {
      const std::int64_t number =
          cells ? first + std::int64_t(e) : grid_.side(block.shape, {block.nodes.data() + e * count, count});
      if (number >= 0) list.add(number);
    }
  }

  void domain() {
    for (const ForeignSection& section : mesh_.foreign)
      if (section.format == "nektar" && section.name == kNektarDomain)
        return out_.text("        " + section.bytes + "\n");
    out_.text("        <DOMAIN> C[");
    out_.text(composites_.domain);
    out_.text("] </DOMAIN>\n");
  }

  static bool is_note(std::string_view name) {
    return name == kNektarDomain || name == kNektarText || name == kNektarZero;
  }

  void others() {
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
    out_.text(composites_.domain);
    out_.text("]\" NUMMODES=\"");
    out_.text_integer(std::max(4, mesh_.order + 1));
    out_.text("\" TYPE=\"MODIFIED\" FIELDS=\"u\" />\n    </EXPANSIONS>\n");
  }

  const NektarGrid& grid_;
  const HighOrderMesh& mesh_;
  const NektarComposites composites_;
  BufferedOutput& out_;
};

}  // namespace

void write_nektar_sections(const NektarGrid& grid, BufferedOutput& out) { Writer(grid, out).write(); }

}  // namespace varimesh::formats
