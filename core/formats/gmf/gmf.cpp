// Source: github.com/LoicMarechal/libMeshb, "The Gamma Mesh Format": libmeshb's table of keywords.
#include "core/formats/gmf/gmf.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <set>

#include "core/base/io/text.h"
#include "core/formats/common/mesh_builder.h"
#include "core/formats/gmf/keywords.h"
#include "core/formats/gmf/numbers.h"
#include "core/formats/numbering/node_order.h"

namespace varimesh::formats {

namespace {

using namespace gmf;

constexpr int kDimension = 3, kVertices = 4, kEnd = 54, kBezier = 125;
constexpr std::int64_t kLargestTag = 1'000'000'000;
constexpr std::string_view kVersion = "MeshVersionFormatted", kOrdering = "Ordering";

class Reading {
 public:
  Reading(std::string_view bytes, const StopToken* stop)
      : numbers_(bytes), allowance_(bytes.size(), stop), builder_(allowance_) {}

  HighOrderMesh take() {
    numbers_.is_binary_file() ? binary_sections() : text_sections();
    read_section(kDimension, "Dimension", [&] { return dimension(); });
    read_section(kBezier, "BezierBasis", [&] { return basis(); });
    read_section(kVertices, "Vertices", [&] { return vertices(); });
    if (nodes_ == 0) numbers_.scan.fail("it has no Vertices");
    for (const Keyword& keyword : kElements)
      if (keyword.order > 1)
        read_section(keyword.ordering, std::string(keyword.name) + std::string(kOrdering),
                     [&] { return ordering(keyword); });
    for (const Keyword& keyword : kElements)
      read_section(keyword.code, keyword.name, [&] { return elements(keyword); });
    if (!has_end_) {
      numbers_.scan.go_to(numbers_.scan.offset() + numbers_.scan.left());
      numbers_.scan.fail("it does not finish with End, as if it were cut; write or copy it again");
    }
    name_other_references();
    return builder_.take();
  }

 private:
  // === Sections ==========================================================================================

  struct Section {
    std::size_t begin, end;
  };

  /// The order of nodes may come after the elements, so sections are only noted, and read at the end.
  void note_section(int code, const std::string& name, Section at) {
    if (code != 0 && !sections_.try_emplace(code, at).second) numbers_.scan.fail(name + " occurs twice");
  }

  void binary_sections() {
    Scanner& scan = numbers_.scan;
    const std::size_t file_end = scan.offset() + scan.left();
    std::size_t last = 0;
    while (!scan.at_end()) {
      allowance_.look();
      const std::int64_t code = numbers_.keyword();
      has_end_ = code == kEnd;
      if (has_end_) return;
      const std::int64_t next = numbers_.position();
      has_end_ = next == 0;
      if (!has_end_ && (next <= std::int64_t(last) || std::size_t(next) > file_end))
        scan.fail("a keyword says that the next one is at byte " + std::to_string(next));
      last = has_end_ ? file_end : std::size_t(next);
      if (is_read(int(code))) note_section(int(code), "keyword " + std::to_string(code), {scan.offset(), last});
      scan.go_to(last);
    }
  }

  void text_sections() {
    Scanner& scan = numbers_.scan;
    std::string_view name;
    int code = 0;
    std::size_t begin = scan.offset();
    while (!has_end_) {
      const std::string_view word = next_word();
      note_section(code, std::string(name), {begin, scan.offset() - word.size()});
      if (word.empty()) return;
      has_end_ = word == "End";
      name = word.substr(0, 40);
      code = code_of(word);
      begin = scan.offset();
    }
  }

  void skip_comments() {
    Scanner& scan = numbers_.scan;
    for (scan.skip_space(); scan.peek() == '#'; scan.skip_space()) scan.line();
  }

  /// The next word that begins with a letter; empty at the end of the file.
  std::string_view next_word() {
    Scanner& scan = numbers_.scan;
    for (;;) {
      allowance_.look();
      skip_comments();
      if (scan.at_end()) return {};
      const std::string_view rest = scan.rest();
      std::size_t length = 0;
      while (length < rest.size() && !is_space(rest[length])) ++length;
      scan.go_to(scan.offset() + length);
      if (std::isalpha(static_cast<unsigned char>(rest.front())) != 0) return rest.substr(0, length);
    }
  }

  static int code_of(std::string_view word) {
    if (word == "Dimension") return kDimension;
    if (word == "Vertices") return kVertices;
    if (word == "BezierBasis" || word == "BezierMode") return kBezier;
    for (const Keyword& keyword : kElements) {
      if (word == keyword.name) return keyword.code;
      if (keyword.order > 1 && word.size() == keyword.name.size() + kOrdering.size() &&
          word.starts_with(keyword.name) && word.ends_with(kOrdering))
        return keyword.ordering;
    }
    return 0;
  }

  static bool is_read(int code) {
    return code == kDimension || code == kVertices || code == kBezier ||
           std::any_of(kElements.begin(), kElements.end(),
                       [&](const Keyword& k) { return code == k.code || (k.order > 1 && code == k.ordering); });
  }

  /// Reads a section once, if the file has it. `body` returns how many numbers each thing of the section has. Nothing
  /// may be left in the section, or else its count would hide things.
  template <class Body>
  void read_section(int code, std::string_view name, const Body& body) {
    const auto found = sections_.extract(code);
    if (found.empty()) return;
    Scanner& scan = numbers_.scan;
    scan.go_to(found.mapped().begin);
    const Thing each = body();
    const std::size_t end = found.mapped().end;
    if (!numbers_.is_binary_file()) skip_comments();
    if (scan.offset() >= end) return;
    const std::size_t left = end - scan.offset();
    if (numbers_.is_binary_file() && left < numbers_.bytes(each))
      scan.fail(std::string(name) + " has " + std::to_string(left) + (left == 1 ? " byte" : " bytes") +
                " more than its count says, too few for another entry; write or copy the file again");
    scan.fail(std::string(name) + " has more numbers than it announces");
  }

  Thing dimension() {
    dimension_ = numbers_.small("the dimension");
    if (dimension_ != 2 && dimension_ != 3)
      numbers_.scan.fail("the dimension is " + std::to_string(dimension_) + "; VariMesh takes 2 and 3");
    return {1, 0};
  }

  Thing basis() {
    if (numbers_.integer("whether nodes are control points") != 0)
      numbers_.scan.fail("its nodes are Bézier control points; write the mesh with Lagrange nodes");
    return {1, 0};
  }

  Thing vertices() {
    if (dimension_ == 0) numbers_.scan.fail("it has Vertices, but no Dimension");
    const Thing each{1, dimension_};
    nodes_ = numbers_.count("the number of vertices", each);
    for (std::int64_t n = 1; n <= nodes_; ++n) {
      allowance_.look();
      std::array<double, 3> at{};
      for (std::int64_t k = 0; k < dimension_; ++k) at[std::size_t(k)] = numbers_.real("a vertex's coordinate");
      (void)numbers_.integer("a vertex's reference");
      builder_.add_node(n, at);
    }
    return each;
  }

  /// For each node of an element in the file, which node of Gmsh's order it is.
  Thing ordering(const Keyword& keyword) {
    const int size = place_size(keyword.shape), count = reference::node_count(keyword.shape, keyword.order);
    const std::string name = std::string(keyword.name) + std::string(kOrdering);
    if (numbers_.integer("the number of nodes in an order") != count)
      numbers_.scan.fail(name + " does not have " + std::to_string(count) + " nodes");
    const std::vector<int>& by_position = nodes_by_position(keyword.shape, keyword.order);
    std::vector<int> order;
    std::vector<bool> seen(std::size_t(count), false);
    for (int n = 0; n < count; ++n) {
      std::array<std::int64_t, 4> at{};
      for (int k = 0; k < size; ++k) at[std::size_t(k)] = numbers_.integer("a place in an order of nodes");
      const bool inside = std::all_of(at.begin(), at.end(), [&](auto x) { return x >= 0 && x <= keyword.order; });
      const auto side = std::size_t(keyword.order) + 1;
      int node = -1;
      if (inside) {
        const Position p = position_of(keyword.shape, at);
        node = by_position[std::size_t(p[0]) + side * (std::size_t(p[1]) + side * std::size_t(p[2]))];
      }
      if (node < 0 || seen[std::size_t(node)])
        numbers_.scan.fail(name + " has a place twice, or one that is not in the element");
      seen[std::size_t(node)] = true;
      order.push_back(node);
    }
    orders_[{int(keyword.shape), keyword.order}] = std::move(order);
    return {size, 0};
  }

  /// Gmsh writes elements of all orders under the keyword of those of order 1, each on a line.
  const Keyword& as_written(const Keyword& keyword) {
    if (numbers_.is_binary_file() || keyword.order > 1) return keyword;
    Scanner& scan = numbers_.scan;
    const std::size_t begin = scan.offset();
    const std::int64_t count = scan.text_integer("the number of elements");
    scan.skip_space();
    const std::array lines = {words_in(scan.line()), words_in(scan.line())};
    scan.go_to(begin);
    for (const Keyword& other : kElements) {
      const int words = reference::node_count(other.shape, other.order) + 1;
      if (other.shape == keyword.shape && lines[0] == words && (count == 1 || lines[1] == words)) return other;
    }
    return keyword;
  }

  static int words_in(std::string_view line) {
    int words = 0;
    bool after_space = true;
    for (const char c : line) {
      words += after_space && !is_space(c) ? 1 : 0;
      after_space = is_space(c);
    }
    return words;
  }

  /// For each node of an element in the file, which node of Gmsh's order it is.
  const std::vector<int>& order_of(const Keyword& keyword, bool is_from_gmsh) const {
    const auto given = orders_.find({int(keyword.shape), keyword.order});
    if (given != orders_.end()) return given->second;
    if (!is_from_gmsh && !has_usual_order(keyword.shape, keyword.order))
      numbers_.scan.fail("it has " + std::string(keyword.name) + ", but not " + std::string(keyword.name) +
                         std::string(kOrdering) + ", which says in what order their nodes are; add it");
    // Of tetrahedra of order 2, Gmsh writes the last two nodes the other way round than in MSH files.
    const bool as_in_cgns = keyword.order == 2 && (!is_from_gmsh || keyword.shape == Shape::Tetrahedron);
    return gmsh_nodes(as_in_cgns ? NodeOrder::Cgns : NodeOrder::Gmsh, keyword.shape, keyword.order);
  }

  Thing elements(const Keyword& listed) {
    const Keyword& keyword = as_written(listed);
    const std::vector<int>& order = order_of(keyword, &keyword != &listed);
    const Thing each{std::int64_t(order.size()) + 1, 0};
    const std::int64_t count = numbers_.count("the number of elements", each);
    std::vector<std::int64_t> nodes(order.size());
    for (std::int64_t e = 0; e < count; ++e) {
      allowance_.look();
      for (const int place : order) {
        std::int64_t& node = nodes[std::size_t(place)];
        node = numbers_.integer("an element's vertex");
        if (node < 1 || node > nodes_)
          numbers_.scan.fail(std::string(keyword.name) + " have the vertex " + std::to_string(node) +
                             ", but vertices are 1 to " + std::to_string(nodes_));
      }
      const std::int64_t reference = numbers_.integer("an element's reference");
      put_into_group(builder_.add_element(keyword.shape, keyword.order, nodes, 0), reference);
    }
    return each;
  }

  // === References ========================================================================================

  /// A reference becomes the tag of a group. 0 means that there is none.
  void put_into_group(std::size_t element, std::int64_t reference) {
    if (reference == 0) return;
    if (reference > 0 && reference <= kLargestTag) {
      if (tags_.insert(int(reference)).second) allowance_.take(1, kTreeNode);
      return builder_.put_into_group(element, int(reference));
    }
    allowance_.make_room(others_, 1);
    others_.emplace_back(reference, element);
  }

  /// References that cannot be tags get the lowest tags that are free, and a name.
  void name_other_references() {
    std::map<std::int64_t, int> tag_of;
    int last = 0;
    for (const auto& [reference, element] : others_) {
      const auto [at, is_new] = tag_of.try_emplace(reference, 0);
      if (is_new) {
        allowance_.take(1, kTreeNode);
        while (tags_.contains(++last)) {
        }
        at->second = last;
        for (int dimension = 1; dimension <= 3; ++dimension)
          builder_.name_group(dimension, last, "reference_" + std::to_string(reference));
      }
      builder_.put_into_group(element, at->second);
    }
  }

  Numbers numbers_;
  FileAllowance allowance_;
  MeshBuilder builder_;
  std::int64_t dimension_ = 0, nodes_ = 0;
  bool has_end_ = false;
  std::map<int, Section> sections_;  ///< Those that are read, by their codes.
  std::map<std::pair<int, int>, std::vector<int>> orders_;
  std::set<int> tags_;
  std::vector<std::pair<std::int64_t, std::size_t>> others_;  ///< References that cannot be tags, and their elements.
};

}  // namespace

bool begins_like_gmf(std::string_view bytes) {
  if (Numbers::is_binary(bytes)) return true;
  std::string_view text = bytes;
  for (;;) {
    while (!text.empty() && is_space(text.front())) text.remove_prefix(1);
    if (!text.starts_with('#')) break;
    text.remove_prefix(std::min(text.find('\n'), text.size()));
  }
  return text.starts_with(kVersion);
}

Expected<MeshFile> read_gmf(std::string_view bytes, const Team& team) {
  return MeshFile{Reading(bytes, team.stop()).take(), Format::Gmf};
}

}  // namespace varimesh::formats
