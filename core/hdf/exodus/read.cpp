#include <algorithm>
#include <array>
#include <cctype>
#include <limits>
#include <set>

#include "core/formats/common/mesh_builder.h"
#include "core/formats/numbering/node_order.h"
#include "core/formats/numbering/sides.h"
#include "core/hdf/exodus/exodus.h"

namespace varimesh::formats {

namespace {

struct Kind {
  std::string_view begins;  ///< The letters of the element's type, in capitals.
  Shape shape;
  int order;
  std::int64_t nodes;
};

constexpr std::array kKinds = {
    Kind{"BAR", Shape::Line, 1, 2},
    Kind{"BAR", Shape::Line, 2, 3},
    Kind{"BEAM", Shape::Line, 1, 2},
    Kind{"BEAM", Shape::Line, 2, 3},
    Kind{"TRUSS", Shape::Line, 1, 2},
    Kind{"TRUSS", Shape::Line, 2, 3},
    Kind{"EDGE", Shape::Line, 1, 2},
    Kind{"EDGE", Shape::Line, 2, 3},
    Kind{"TRI", Shape::Triangle, 1, 3},
    Kind{"TRI", Shape::Triangle, 2, 6},
    Kind{"SHELL", Shape::Triangle, 1, 3},
    Kind{"SHELL", Shape::Triangle, 2, 6},
    Kind{"QUAD", Shape::Quadrilateral, 1, 4},
    Kind{"QUAD", Shape::Quadrilateral, 2, 8},
    Kind{"QUAD", Shape::Quadrilateral, 2, 9},
    Kind{"SHELL", Shape::Quadrilateral, 1, 4},
    Kind{"SHELL", Shape::Quadrilateral, 2, 8},
    Kind{"SHELL", Shape::Quadrilateral, 2, 9},
    Kind{"TET", Shape::Tetrahedron, 1, 4},
    Kind{"TET", Shape::Tetrahedron, 2, 10},
    Kind{"PYRAMID", Shape::Pyramid, 1, 5},
    Kind{"PYRAMID", Shape::Pyramid, 2, 13},
    Kind{"PYRAMID", Shape::Pyramid, 2, 14},
    Kind{"WEDGE", Shape::Prism, 1, 6},
    Kind{"WEDGE", Shape::Prism, 2, 15},
    Kind{"WEDGE", Shape::Prism, 2, 18},
    Kind{"HEX", Shape::Hexahedron, 1, 8},
    Kind{"HEX", Shape::Hexahedron, 2, 20},
    Kind{"HEX", Shape::Hexahedron, 2, 27},
};

constexpr std::array kLeftOut = {"SPHERE", "CIRCLE", "POINT", "NSIDED", "NFACED", "NULL"};

const Kind* kind_of(const std::string& type, std::int64_t nodes) {
  const auto* found = std::find_if(kKinds.begin(), kKinds.end(), [&](const Kind& kind) {
    return kind.nodes == nodes && type.starts_with(kind.begins);
  });
  return found == kKinds.end() ? nullptr : &*found;
}

class Reading {
 public:
  Reading(Hdf5Source& source, FileAllowance& allowance)
      : allowance_(allowance), root_(source, allowance, "/"), builder_(allowance) {}

  HighOrderMesh take() {
    read_nodes();
    const std::vector<std::int64_t> tags = ids("eb_prop1");
    const std::vector<std::string> names = texts("eb_names");
    // A block without elements has an id, but no array.
    for (std::size_t b = 0; b < tags.size() || root_.find(name("connect", b)) != nullptr; ++b)
      if (root_.find(name("connect", b)) != nullptr) read_block(b, tags, names);
    if (builder_.element_count() == 0) root_.fail("connect1", "is missing, so the file has no elements");
    const std::vector<std::int64_t> set_tags = ids("ss_prop1");
    const std::vector<std::string> set_names = texts("ss_names");
    side_ids_.insert(set_tags.begin(), set_tags.end());
    for (std::size_t s = 0; s < set_tags.size(); ++s) read_sides(s, set_tags, set_names);
    return builder_.take();
  }

 private:
  static std::string name(const char* what, std::size_t number) { return what + std::to_string(number + 1); }

  std::vector<std::int64_t> ids(const char* array) const {
    return root_.find(array) == nullptr ? std::vector<std::int64_t>() : root_.integers(array);
  }

  /// Texts are rows of single characters.
  std::vector<std::string> texts(const char* array) const {
    const Hdf5Item* item = root_.find(array);
    if (item == nullptr || item->dims.size() != 2 || item->kind != hdf5::Kind::Texts || item->width != 1) return {};
    const std::vector<std::string> letters = root_.texts(array);
    std::vector<std::string> all(std::size_t(item->rows()));
    const auto columns = std::size_t(item->columns());
    for (std::size_t i = 0; i < letters.size(); ++i) all[i / columns] += letters[i];
    return all;
  }

  /// The tag of a group with this position in the list of ids; positions from 1 where ids are no tags.
  static int tag(const std::vector<std::int64_t>& ids, std::size_t number) {
    const bool fine = std::all_of(ids.begin(), ids.end(), [](std::int64_t id) {
      return id > 0 && id <= std::numeric_limits<std::int32_t>::max();
    });
    return fine && number < ids.size() ? int(ids[number]) : int(number) + 1;
  }

  void read_nodes() {
    std::array<std::vector<double>, 3> x;
    const bool together = root_.find("coord") != nullptr;
    std::int64_t count = -1, dimension = 0;
    const auto take_row = [&](const double* values, std::int64_t n) {
      if (dimension >= 3) root_.fail("coord", "has more than three rows");
      allowance_.take(std::size_t(n), sizeof(double));
      x[std::size_t(dimension++)].assign(values, values + n);
      count = n;
    };
    if (together) {
      const std::int64_t columns = root_.need("coord", hdf5::Kind::Numbers, false).columns();
      root_.for_rows<double>("coord", 0, [&](std::int64_t, std::int64_t rows, const double* values) {
        for (std::int64_t r = 0; r < rows; ++r) take_row(values + r * columns, columns);
      });
    } else {
      for (const char* each : {"coordx", "coordy", "coordz"}) {
        if (root_.find(each) == nullptr) break;
        std::vector<double>& own = x[std::size_t(dimension++)];
        const std::int64_t n =
            root_.for_rows<double>(each, 1, [&](std::int64_t, std::int64_t rows, const double* values) {
              allowance_.make_room(own, std::size_t(rows));
              own.insert(own.end(), values, values + rows);
            });
        if (count >= 0 && n != count) root_.fail(each, "has another length than coordx");
        count = n;
      }
    }
    if (dimension < 2) root_.fail(together ? "coord" : "coordx", "does not give every node two or three coordinates");
    const std::vector<std::int64_t> numbers = numbers_of("node_num_map", count);
    for (std::int64_t n = 0; n < count; ++n) {
      std::array<double, 3> at{};
      for (std::size_t k = 0; k < std::size_t(dimension); ++k) at[k] = x[k][std::size_t(n)];
      builder_.add_node(numbers.empty() ? n + 1 : numbers[std::size_t(n)], at);
    }
    nodes_ = count;
    dimension_ = dimension;
    node_numbers_ = numbers;
  }

  /// The numbers that a file gives to its nodes; nothing if it gives none, or not every node its own.
  std::vector<std::int64_t> numbers_of(const char* array, std::int64_t count) const {
    std::vector<std::int64_t> numbers = ids(array), sorted = numbers;
    std::sort(sorted.begin(), sorted.end());
    const bool fine = std::int64_t(numbers.size()) == count && !sorted.empty() && sorted.front() > 0 &&
                      std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end();
    return fine ? numbers : std::vector<std::int64_t>();
  }

  std::string type_of(const std::string& array) const {
    const std::vector<std::string> texts = root_.attributes_of(array).texts("elem_type", true);
    std::string type = texts.empty() ? "" : texts[0];
    std::transform(type.begin(), type.end(), type.begin(), [](unsigned char c) { return char(std::toupper(c)); });
    return type;
  }

  void read_block(std::size_t b, const std::vector<std::int64_t>& tags, const std::vector<std::string>& names) {
    const std::string array = name("connect", b);
    const std::string type = type_of(array);
    const Hdf5Item& item = root_.need(array, hdf5::Kind::Integers, false);
    const std::int64_t columns = item.columns();
    if (std::any_of(kLeftOut.begin(), kLeftOut.end(), [&](const char* each) { return type.starts_with(each); })) {
      numbers_ += item.rows();
      return;
    }
    const Kind* kind = kind_of(type, columns);
    if (kind == nullptr)
      root_.fail(array,
                 "has elements of type '" + type.substr(0, 32) + "' with " + std::to_string(columns) +
                     " nodes, which VariMesh does not read; write the mesh with complete elements of order 1 or 2");
    const int own = tag(tags, b), dimension = reference::info(kind->shape).dimension;
    allowance_.take(1, kTreeNode);
    tags_.emplace(dimension, own);
    builder_.name_group(dimension, own,
                        b < names.size() && !names[b].empty() ? names[b] : "block_" + std::to_string(own));
    const std::vector<int>& place = gmsh_nodes(NodeOrder::Exodus, kind->shape, kind->order);
    const bool is_shell =
        type.find("SHELL") != std::string::npos || (kind->shape == Shape::Triangle && dimension_ == 3);
    std::vector<std::int64_t> nodes(static_cast<std::size_t>(columns));
    root_.for_rows<std::int64_t>(
        array, columns, [&](std::int64_t first, std::int64_t rows, const std::int64_t* values) {
          for (std::int64_t r = 0; r < rows; ++r) {
            for (std::size_t i = 0; i < nodes.size(); ++i) {
              const std::int64_t node = values[r * columns + std::int64_t(i)];
              if (node < 1 || node > nodes_)
                root_.fail(array,
                           "has the node " + std::to_string(node) + ", but nodes are 1 to " + std::to_string(nodes_),
                           first + r);
              nodes[std::size_t(place[i])] = node_numbers_.empty() ? node : node_numbers_[std::size_t(node) - 1];
            }
            allowance_.take(1, sizeof(Numbered));
            numbered_.push_back({++numbers_, builder_.element_count(), is_shell});
            builder_.put_into_group(builder_.add_element(kind->shape, kind->order, nodes, numbers_), own);
          }
        });
  }

  void read_sides(std::size_t s, const std::vector<std::int64_t>& tags, const std::vector<std::string>& names) {
    if (root_.find(name("elem_ss", s)) == nullptr || root_.find(name("side_ss", s)) == nullptr) return;
    const std::vector<std::int64_t> elements = root_.integers(name("elem_ss", s)),
                                    sides = root_.integers(name("side_ss", s));
    if (elements.size() != sides.size())
      root_.fail(name("side_ss", s), "has another length than the array of elements");
    const int own = tag(tags, s);
    const std::string group = s < names.size() && !names[s].empty() ? names[s] : "side_set_" + std::to_string(own);
    std::array<int, 3> tag_in{};  // by dimension; 0: no element yet
    for (std::size_t i = 0; i < elements.size(); ++i) {
      const std::int64_t number = elements[i];
      if (number < 1 || number > numbers_)
        root_.fail(name("elem_ss", s),
                   "has the element " + std::to_string(number) + ", but elements are 1 to " + std::to_string(numbers_),
                   std::int64_t(i));
      const auto found = std::lower_bound(numbered_.begin(), numbered_.end(), number,
                                          [](const Numbered& each, std::int64_t n) { return each.number < n; });
      if (found == numbered_.end() || found->number != number) continue;  // it was left out
      const std::size_t element = side_of(*found, sides[i], name("side_ss", s), std::int64_t(i));
      int& tag = tag_in[std::size_t(builder_.dimension(element))];
      if (tag == 0) {
        tag = tag_of_sides(builder_.dimension(element), own);
        builder_.name_group(builder_.dimension(element), tag, group);
      }
      builder_.put_into_group(element, tag);
    }
  }

  /// An element, by its number in the file.
  struct Numbered {
    std::int64_t number;
    std::size_t index;
    bool is_shell;
  };

  /// The id of a side set, or a free tag if a block of this dimension has the same id.
  int tag_of_sides(int dimension, int id) {
    if (tags_.contains({dimension, id}))
      for (id = 1; tags_.contains({dimension, id}) || side_ids_.contains(id);) ++id;
    allowance_.take(1, kTreeNode);
    tags_.emplace(dimension, id);
    return id;
  }

  std::size_t side_of(const Numbered& of, std::int64_t side, const std::string& array, std::int64_t row) {
    const Shape shape = builder_.shape(of.index);
    const auto all = faces_of(Sides::Exodus, shape);
    if (of.is_shell) {  // whose sides 1 and 2 are the shell itself, seen from either side
      if (side == 1 || side == 2) return of.index;
      side -= 2;
    }
    if (side < 1 || side > std::int64_t(all.size()))
      root_.fail(array,
                 "has the side " + std::to_string(side) + " of an element that has " + std::to_string(all.size()), row);
    const int facet = same_sides(all, reference::info(shape).facets)[std::size_t(side) - 1];
    return builder_.add_side(of.index, facet);
  }

  FileAllowance& allowance_;
  Hdf5Group root_;
  MeshBuilder builder_;
  std::int64_t nodes_ = 0, numbers_ = 0, dimension_ = 0;
  std::set<std::pair<int, int>> tags_;  ///< Dimensions and tags that are taken.
  std::set<std::int64_t> side_ids_;
  std::vector<std::int64_t> node_numbers_;
  std::vector<Numbered> numbered_;
};

}  // namespace

MeshFile read_exodus(Hdf5Source& source, FileAllowance& allowance) {
  return {Reading(source, allowance).take(), Format::Exodus};
}

}  // namespace varimesh::formats
