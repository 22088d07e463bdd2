// Source: github.com/LoicMarechal/libMeshb, "The Gamma Mesh Format": libmeshb's table of keywords.
#include "core/formats/gmf/gmf.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <cstring>
#include <map>

#include "core/base/io/scanner.h"
#include "core/formats/common/mesh_builder.h"
#include "core/formats/numbering/node_order.h"

namespace varimesh::formats {

namespace {

/// A keyword of elements, and that of the order of their nodes.
struct Keyword {
  std::string_view name;
  int code;
  int ordering;  ///< Code of the keyword with "Ordering" after the name; 0: there is none.
  Shape shape;
  int order;
};

constexpr std::array kElements = {
    Keyword{"Edges", 5, 141, Shape::Line, 1},
    Keyword{"Triangles", 6, 143, Shape::Triangle, 1},
    Keyword{"Quadrilaterals", 7, 145, Shape::Quadrilateral, 1},
    Keyword{"Tetrahedra", 8, 147, Shape::Tetrahedron, 1},
    Keyword{"Prisms", 9, 151, Shape::Prism, 1},
    Keyword{"Pentahedra", 9, 151, Shape::Prism, 1},
    Keyword{"Hexahedra", 10, 153, Shape::Hexahedron, 1},
    Keyword{"Hexaedra", 10, 153, Shape::Hexahedron, 1},
    Keyword{"Pyramids", 49, 149, Shape::Pyramid, 1},
    Keyword{"EdgesP2", 25, 127, Shape::Line, 2},
    Keyword{"TrianglesP2", 24, 129, Shape::Triangle, 2},
    Keyword{"QuadrilateralsQ2", 27, 131, Shape::Quadrilateral, 2},
    Keyword{"TetrahedraP2", 30, 133, Shape::Tetrahedron, 2},
    Keyword{"PrismsP2", 86, 137, Shape::Prism, 2},
    Keyword{"HexahedraQ2", 33, 139, Shape::Hexahedron, 2},
    Keyword{"PyramidsP2", 87, 135, Shape::Pyramid, 2},
    Keyword{"EdgesP3", 92, 128, Shape::Line, 3},
    Keyword{"TrianglesP3", 90, 130, Shape::Triangle, 3},
    Keyword{"QuadrilateralsQ3", 88, 132, Shape::Quadrilateral, 3},
    Keyword{"TetrahedraP3", 96, 134, Shape::Tetrahedron, 3},
    Keyword{"PrismsP3", 102, 138, Shape::Prism, 3},
    Keyword{"HexahedraQ3", 98, 140, Shape::Hexahedron, 3},
    Keyword{"PyramidsP3", 100, 136, Shape::Pyramid, 3},
    Keyword{"EdgesP4", 93, 142, Shape::Line, 4},
    Keyword{"TrianglesP4", 91, 144, Shape::Triangle, 4},
    Keyword{"QuadrilateralsQ4", 89, 146, Shape::Quadrilateral, 4},
    Keyword{"TetrahedraP4", 97, 148, Shape::Tetrahedron, 4},
    Keyword{"PrismsP4", 103, 152, Shape::Prism, 4},
    Keyword{"HexahedraQ4", 99, 154, Shape::Hexahedron, 4},
    Keyword{"PyramidsP4", 101, 150, Shape::Pyramid, 4},
};

constexpr int kDimension = 3, kVertices = 4, kEnd = 54, kBezier = 125;
constexpr std::string_view kVersion = "MeshVersionFormatted", kOrdering = "Ordering";

/// How many numbers give a place in a shape: barycentric ones in simplices, and positions along axes.
int place_size(Shape shape) {
  switch (shape) {
    case Shape::Line:
      return 1;
    case Shape::Quadrilateral:
      return 2;
    case Shape::Triangle:
    case Shape::Hexahedron:
    case Shape::Pyramid:
      return 3;
    default:
      return 4;
  }
}

/// The position on the lattice. Barycentric numbers belong to the vertices in turn.
Position position_of(Shape shape, const std::array<std::int64_t, 4>& at) {
  const auto [a, b, c, d] = at;
  switch (shape) {
    case Shape::Triangle:
      return {int(b), int(c), 0};
    case Shape::Tetrahedron:
      return {int(b), int(c), int(d)};
    case Shape::Prism:
      return {int(b), int(c), int(d)};
    default:
      return {int(a), int(b), int(c)};
  }
}

/// Whether the order of nodes is the same in all programs.
bool has_usual_order(Shape shape, int order) {
  return order == 1 || shape == Shape::Line || (shape == Shape::Triangle && order < 4) ||
         (shape == Shape::Tetrahedron && order == 2);
}

bool is_binary(std::string_view bytes) {
  std::array<std::int32_t, 2> first{};
  if (bytes.size() < sizeof first) return false;
  std::memcpy(first.data(), bytes.data(), sizeof first);
  constexpr std::int32_t kSwapped = 1 << 24;
  const bool own = first[0] == 1 && first[1] >= 1 && first[1] <= 4;
  return own || (first[0] == kSwapped && first[1] % kSwapped == 0 && first[1] >= kSwapped && first[1] <= 4 * kSwapped);
}

/// The numbers of a file, as text or binary of either byte order.
class Numbers {
 public:
  explicit Numbers(std::string_view bytes) : scan(bytes), binary_(is_binary(bytes)) {
    if (!binary_) return;
    std::int32_t first = 0;
    std::memcpy(&first, bytes.data(), sizeof first);
    swapped_ = first != 1;
    (void)raw<std::int32_t>("the byte order");
    version = raw<std::int32_t>("the version");
  }

  Scanner scan;
  std::int64_t version = 1;
  bool is_binary_file() const { return binary_; }

  std::int64_t keyword() { return raw<std::int32_t>("a keyword"); }
  std::int64_t position() { return version < 3 ? raw<std::int32_t>("a position") : raw<std::int64_t>("a position"); }
  std::int64_t small(const char* what) { return binary_ ? raw<std::int32_t>(what) : scan.text_integer(what); }
  std::int64_t integer(const char* what) {
    if (!binary_) return scan.text_integer(what);
    return version < 4 ? raw<std::int32_t>(what) : raw<std::int64_t>(what);
  }
  double real(const char* what) {
    if (!binary_) return scan.text_number(what);
    return version == 1 ? double(raw<float>(what)) : raw<double>(what);
  }
  /// Reads a count of things, and checks that the file has room for them. Each has `integers` integers and `reals`
  /// reals.
  std::int64_t count(const char* what, std::int64_t integers, std::int64_t reals) {
    const std::int64_t n = integer(what);
    const std::int64_t each =
        binary_ ? integers * (version < 4 ? 4 : 8) + reals * (version == 1 ? 4 : 8) : 2 * (integers + reals);
    if (n < 0 || n > std::int64_t(scan.left()) / each + 1)
      scan.fail_truncated(("everything that " + std::string(what) + ", " + std::to_string(n) + ", announces").c_str());
    return n;
  }

 private:
  template <class T>
  T raw(const char* what) {
    if (scan.left() < sizeof(T)) scan.fail_truncated(what);
    std::array<char, sizeof(T)> bytes;
    std::memcpy(bytes.data(), scan.rest().data(), sizeof(T));
    if (swapped_) std::reverse(bytes.begin(), bytes.end());
    scan.go_to(scan.offset() + sizeof(T));
    return std::bit_cast<T>(bytes);
  }

  bool binary_;
  bool swapped_ = false;
};

class Reading {
 public:
  Reading(std::string_view bytes, const StopToken* stop)
      : numbers_(bytes), allowance_(bytes.size(), stop), builder_(allowance_) {}

  HighOrderMesh take() {
    numbers_.is_binary_file() ? binary_sections() : text_sections();
    if (nodes_ == 0) numbers_.scan.fail("it has no Vertices");
    for (const auto& [keyword, at] : found_) {
      numbers_.scan.go_to(at);
      elements(*keyword);
    }
    return builder_.take();
  }

 private:
  // === Sections ==========================================================================================

  /// The order of nodes may come after the elements, so these are only noted, and read at the end.
  void binary_sections() {
    const Scanner& scan = numbers_.scan;
    while (!scan.at_end()) {
      allowance_.look();
      const std::int64_t code = numbers_.keyword();
      if (code == kEnd) return;
      const std::int64_t next = numbers_.position();
      section(int(code), std::string("keyword ") + std::to_string(code));
      if (next == 0) return;
      if (next <= std::int64_t(last_) || std::size_t(next) > scan.offset() + scan.left())
        scan.fail("a keyword says that the next one is at byte " + std::to_string(next));
      last_ = std::size_t(next);
      numbers_.scan.go_to(last_);
    }
  }

  void text_sections() {
    Scanner& scan = numbers_.scan;
    for (std::string_view word = next_word(); !word.empty() && word != "End"; word = next_word()) {
      allowance_.look();
      if (word == kVersion) {
        numbers_.version = scan.text_integer("the version");
      } else {
        section(code_of(word), std::string(word.substr(0, 40)));
      }
    }
  }

  /// The next word that begins with a letter: numbers of sections that are not read are skipped.
  std::string_view next_word() {
    Scanner& scan = numbers_.scan;
    for (;;) {
      scan.skip_space();
      if (scan.at_end()) return {};
      const std::string_view rest = scan.rest();
      if (rest.front() == '#') {
        scan.line();
        continue;
      }
      std::size_t length = 0;
      while (length < rest.size() && static_cast<unsigned char>(rest[length]) > ' ') ++length;
      scan.go_to(scan.offset() + length);
      if (std::isalpha(static_cast<unsigned char>(rest.front())) != 0) return rest.substr(0, length);
      allowance_.look();
    }
  }

  static int code_of(std::string_view word) {
    if (word == "Dimension") return kDimension;
    if (word == "Vertices") return kVertices;
    if (word == "BezierBasis" || word == "BezierMode") return kBezier;
    for (const Keyword& keyword : kElements) {
      if (word == keyword.name) return keyword.code;
      if (word.size() == keyword.name.size() + kOrdering.size() && word.starts_with(keyword.name) &&
          word.ends_with(kOrdering))
        return keyword.ordering;
    }
    return 0;
  }

  void section(int code, const std::string& name) {
    Scanner& scan = numbers_.scan;
    if (code == kDimension) {
      dimension_ = numbers_.small("the dimension");
      if (dimension_ != 2 && dimension_ != 3)
        scan.fail("the dimension is " + std::to_string(dimension_) + "; VariMesh takes 2 and 3");
      return;
    }
    if (code == kBezier && numbers_.integer("whether nodes are control points") != 0)
      scan.fail("its nodes are Bézier control points; write the mesh with Lagrange nodes");
    if (code == kVertices) return vertices();
    for (const Keyword& keyword : kElements) {
      if (code == keyword.ordering && keyword.order > 1) return ordering(keyword);
      if (code != keyword.code) continue;
      if (found_.contains(&keyword)) scan.fail(name + " occurs twice");
      found_[&keyword] = scan.offset();
      return;
    }
  }

  void vertices() {
    Scanner& scan = numbers_.scan;
    if (dimension_ == 0) scan.fail("Vertices come before Dimension");
    if (nodes_ > 0) scan.fail("Vertices occur twice");
    nodes_ = numbers_.count("the number of vertices", 1, dimension_);
    for (std::int64_t n = 1; n <= nodes_; ++n) {
      allowance_.look();
      std::array<double, 3> at{};
      for (std::int64_t k = 0; k < dimension_; ++k) at[std::size_t(k)] = numbers_.real("a vertex's coordinate");
      (void)numbers_.integer("a vertex's reference");
      builder_.add_node(n, at);
    }
  }

  /// For each node of an element in the file, which node of Gmsh's order it is.
  void ordering(const Keyword& keyword) {
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
  }

  /// Gmsh writes elements of order 2 under the keyword of those of order 1, each on a line.
  const Keyword& as_written(const Keyword& keyword) {
    if (numbers_.is_binary_file() || keyword.order > 1) return keyword;
    Scanner& scan = numbers_.scan;
    const std::size_t begin = scan.offset();
    const std::int64_t count = scan.text_integer("the number of elements");
    scan.skip_space();
    const std::array lines = {words_in(scan.line()), words_in(scan.line())};
    scan.go_to(begin);
    for (const Keyword& other : kElements) {
      const int words = reference::node_count(other.shape, 2) + 1;
      if (other.shape == keyword.shape && other.order == 2 && lines[0] == words && (count == 1 || lines[1] == words))
        return other;
    }
    return keyword;
  }

  static int words_in(std::string_view line) {
    int words = 0;
    bool after_space = true;
    for (const char c : line) {
      const bool is_space = static_cast<unsigned char>(c) <= ' ';
      words += after_space && !is_space ? 1 : 0;
      after_space = is_space;
    }
    return words;
  }

  void elements(const Keyword& listed) {
    const Keyword& keyword = as_written(listed);
    const auto given = orders_.find({int(keyword.shape), keyword.order});
    if (given == orders_.end() && !has_usual_order(keyword.shape, keyword.order))
      numbers_.scan.fail("it has " + std::string(keyword.name) + ", but not " + std::string(keyword.name) +
                         std::string(kOrdering) + ", which says in what order their nodes are; add it");
    const std::vector<int>& order =
        given != orders_.end()
            ? given->second
            : gmsh_nodes(keyword.order == 2 ? NodeOrder::Cgns : NodeOrder::Gmsh, keyword.shape, keyword.order);
    const std::int64_t count = numbers_.count("the number of elements", std::int64_t(order.size()) + 1, 0);
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
      const std::size_t element = builder_.add_element(keyword.shape, keyword.order, nodes, 0);
      // References are any numbers; groups have positive tags.
      if (reference > 0 && reference <= 1'000'000'000) builder_.put_into_group(element, int(reference));
    }
  }

  Numbers numbers_;
  FileAllowance allowance_;
  MeshBuilder builder_;
  std::int64_t dimension_ = 0, nodes_ = 0;
  std::size_t last_ = 0;
  std::map<const Keyword*, std::size_t> found_;  ///< Where each list of elements begins, in the order of the table.
  std::map<std::pair<int, int>, std::vector<int>> orders_;
};

}  // namespace

bool begins_like_gmf(std::string_view bytes) {
  if (is_binary(bytes)) return true;
  std::string_view text = bytes;
  const auto is_space = [](char c) { return static_cast<unsigned char>(c) <= ' '; };
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
