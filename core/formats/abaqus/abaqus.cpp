#include "core/formats/abaqus/abaqus.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <map>
#include <optional>
#include <unordered_map>

#include "core/base/io/scanner.h"
#include "core/base/io/text.h"
#include "core/formats/common/mesh_builder.h"
#include "core/formats/common/reading_notes.h"
#include "core/formats/numbering/node_order.h"
#include "core/formats/numbering/sides.h"

namespace varimesh::formats {

namespace {

std::string upper(std::string_view text) {
  std::string all(text);
  std::transform(all.begin(), all.end(), all.begin(), [](unsigned char c) { return char(std::toupper(c)); });
  return all;
}

/// The text up to the next comma, which is taken away.
std::string_view next_field(std::string_view& line) {
  const std::size_t comma = std::min(line.find(','), line.size());
  const std::string_view field = trimmed(line.substr(0, comma));
  line.remove_prefix(std::min(comma + 1, line.size()));
  return field;
}

/// A keyword line: *NAME, PARAMETER=value, … Names are in capitals, and values as they are.
struct Keyword {
  std::string name;
  std::map<std::string, std::string> parameters;

  explicit Keyword(std::string_view line) {
    line.remove_prefix(1);
    name = upper(next_field(line));
    add(line);
  }
  /// Adds the parameters of the line, or of the next one, where the keyword goes on.
  void add(std::string_view line) {
    while (!line.empty()) {
      const std::string_view field = next_field(line);
      if (field.empty()) continue;
      const std::size_t equals = std::min(field.find('='), field.size());
      std::string_view value = trimmed(field.substr(std::min(equals + 1, field.size())));
      if (value.size() > 1 && value.front() == '"' && value.back() == '"') value = value.substr(1, value.size() - 2);
      parameters[upper(trimmed(field.substr(0, equals)))] = value;
    }
  }
  std::string get(const char* parameter) const {
    const auto found = parameters.find(parameter);
    return found == parameters.end() ? "" : found->second;
  }
};

struct Kind {
  Shape shape;
  int order;
  int nodes;
};

/// What the letters before the number of nodes say.
struct Family {
  std::string_view prefix;
  int dimension;
};

constexpr std::array kFamilies = {
    Family{"C3D", 3},  Family{"DC3D", 3}, Family{"AC3D", 3},  Family{"CPS", 2},  Family{"CPE", 2},
    Family{"CPEG", 2}, Family{"CAX", 2},  Family{"DC2D", 2},  Family{"AC2D", 2}, Family{"DCAX", 2},
    Family{"M3D", 2},  Family{"R3D", 2},  Family{"SFM3D", 2}, Family{"S", 2},    Family{"DS", 2},
    Family{"STRI", 2}, Family{"T2D", 1},  Family{"T3D", 1},   Family{"R2D", 1},
};

/// The element of this type, or nothing if the type is not known. Letters after the number of nodes say how it is
/// integrated.
std::optional<Kind> kind_of(std::string_view type) {
  const auto number_after = [&](std::size_t from) {
    int value = 0;
    (void)std::from_chars(type.data() + std::min(from, type.size()), type.data() + type.size(), value);
    return value;
  };
  if (type.starts_with("B2") || type.starts_with("B3"))  // B31 is a beam in space, of order 1
    return number_after(2) == 2 ? Kind{Shape::Line, 2, 3} : Kind{Shape::Line, 1, 2};
  int nodes = 0, dimension = 0;
  for (const Family& family : kFamilies) {
    if (!type.starts_with(family.prefix) || number_after(family.prefix.size()) == 0) continue;
    nodes = type.starts_with("STRI65") ? 6 : number_after(family.prefix.size());
    dimension = family.dimension;
  }
  constexpr std::array kKinds = {
      Kind{Shape::Line, 1, 2},          Kind{Shape::Line, 2, 3},          Kind{Shape::Triangle, 1, 3},
      Kind{Shape::Triangle, 2, 6},      Kind{Shape::Quadrilateral, 1, 4}, Kind{Shape::Quadrilateral, 2, 8},
      Kind{Shape::Quadrilateral, 2, 9}, Kind{Shape::Tetrahedron, 1, 4},   Kind{Shape::Tetrahedron, 2, 10},
      Kind{Shape::Pyramid, 1, 5},       Kind{Shape::Prism, 1, 6},         Kind{Shape::Prism, 2, 15},
      Kind{Shape::Hexahedron, 1, 8},    Kind{Shape::Hexahedron, 2, 20},   Kind{Shape::Hexahedron, 2, 27},
  };
  for (const Kind& kind : kKinds)
    if (kind.nodes == nodes && reference::info(kind.shape).dimension == dimension) return kind;
  return std::nullopt;
}

class Reading {
 public:
  Reading(std::string_view bytes, const StopToken* stop)
      : bytes_(bytes), scan_(bytes), allowance_(bytes.size(), stop), builder_(allowance_) {}

  HighOrderMesh take() {
    read([this](const Keyword& keyword) { return section(keyword); });
    scan_ = Scanner(bytes_);  // sets and surfaces may come before the elements that they name
    read([this](const Keyword& keyword) { return section_of_groups(keyword); });
    put_into_groups();
    HighOrderMesh mesh = builder_.take();
    std::vector<std::string> notes;
    for (const auto& [type, count] : left_out_)
      notes.push_back(std::to_string(count) + (count == 1 ? " element" : " elements") + " of type " + type +
                      (count == 1 ? " was" : " were") + " left out, because VariMesh does not read this type.");
    note_reading(mesh, notes);
    return mesh;
  }

 private:
  /// Reads the file with one function for all its sections, which returns the first line of the next section.
  template <class Section>
  void read(const Section& of) {
    std::string_view line = next_line();
    while (!line.empty()) {
      if (line.front() != '*') scan_.fail("a keyword that begins with * was expected");
      Keyword keyword(line);
      for (; line.ends_with(','); keyword.add(line)) line = next_line();
      line = of(keyword);
    }
  }

  // === Lines =============================================================================================

  /// The next line that is neither empty nor a comment; empty at the end of the file.
  std::string_view next_line() {
    while (!scan_.at_end()) {
      allowance_.look();
      const std::string_view line = trimmed(scan_.line());
      if (!line.empty() && !line.starts_with("**")) return line;
    }
    return {};
  }

  /// Calls body(line) for each line of data, and returns the next line that begins a section.
  template <class Body>
  std::string_view for_data(const Body& body) {
    std::string_view line = next_line();
    for (; !line.empty() && line.front() != '*'; line = next_line()) body(line);
    return line;
  }

  std::int64_t integer(std::string_view field, const char* what) const {
    std::int64_t value = 0;
    const auto [stop, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    const std::string_view rest = field.substr(std::size_t(stop - field.data()));
    // meshio writes the numbers of sets as 17.0.
    if (error != std::errc() || !(rest.empty() || rest == "." || rest == ".0"))
      scan_.fail(std::string(what) + " was expected before the end of this line");
    return value;
  }
  double number(std::string_view field) const {
    if (field.empty()) return 0;
    if (field.front() == '+') field.remove_prefix(1);
    std::string text(field);
    if (const std::size_t exponent = text.find_first_of("dD"); exponent != std::string::npos)
      text[exponent] = 'e';  // as Fortran writes it
    double value = 0;
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc::invalid_argument || stop != text.data() + text.size())
      scan_.fail("a coordinate was expected before the end of this line");
    if (error != std::errc()) {
      // Below the smallest number a coordinate is 0; above the largest one it is none.
      value = std::strtod(text.c_str(), nullptr);
      if (!std::isfinite(value)) scan_.fail("a coordinate is not a finite number");
    }
    return value;
  }

  // === Sections ==========================================================================================

  std::string_view section(const Keyword& keyword) {
    if (keyword.parameters.contains("INPUT"))
      scan_.fail("the file takes *" + keyword.name.substr(0, 40) + " from another file; put its lines into this one");
    if (keyword.name == "ASSEMBLY" || keyword.name == "END ASSEMBLY") in_assembly_ = keyword.name == "ASSEMBLY";
    if (keyword.name == "INSTANCE" || keyword.name == "END INSTANCE") in_instance_ = keyword.name == "INSTANCE";
    // Nodes and elements of the assembly itself, such as reference points and masses, have numbers of their own.
    const bool is_of_the_mesh = !in_assembly_ || in_instance_;
    if (keyword.name == "NODE" && is_of_the_mesh) return nodes(keyword);
    if (keyword.name == "ELEMENT" && is_of_the_mesh) return elements(keyword);
    if (keyword.name == "SYSTEM")
      scan_.fail("*SYSTEM moves the nodes that follow; write the mesh with the coordinates of the whole model");
    if (keyword.name == "INCLUDE") scan_.fail("the file includes another one; put its lines into this one");
    if (keyword.name == "PART" && ++parts_ > 1)
      scan_.fail("it has several parts; write it without parts, so that numbers are those of the whole model");
    if (keyword.name == "INSTANCE")
      return for_data([&](std::string_view) {
        scan_.fail("an instance moves its part; write the mesh without parts and instances");
      });
    if (keyword.name == "NGEN" || keyword.name == "NFILL" || keyword.name == "ELGEN" || keyword.name == "NCOPY" ||
        keyword.name == "ELCOPY")
      scan_.fail("*" + keyword.name + " generates nodes or elements; write the mesh with all of them listed");
    return for_data([](std::string_view) {});
  }

  std::string_view section_of_groups(const Keyword& keyword) {
    if (keyword.name == "ELSET") return set(keyword);
    if (keyword.name == "SURFACE") return surface(keyword);
    return for_data([](std::string_view) {});
  }

  std::string_view nodes(const Keyword& keyword) {
    const std::string system = keyword.get("SYSTEM");
    if (!system.empty() && upper(system) != "R") scan_.fail("nodes have coordinates that are not rectangular");
    return for_data([&](std::string_view line) {
      const std::int64_t own = integer(next_field(line), "a node's number");
      std::array<double, 3> at{};
      for (double& x : at) x = number(next_field(line));
      builder_.add_node(own, at);
    });
  }

  /// An element has the nodes of this line and of the next ones, until it has all of them.
  std::string_view elements(const Keyword& keyword) {
    const std::string type = upper(keyword.get("TYPE"));
    if (type.empty()) scan_.fail("*ELEMENT has no TYPE");
    const std::optional<Kind> kind = kind_of(type);
    if (!kind) {
      std::int64_t& count = left_out_[type.substr(0, 40)];
      return for_data([&](std::string_view line) { count += line.back() == ',' ? 0 : 1; });
    }
    const std::vector<int>& place = gmsh_nodes(NodeOrder::Abaqus, kind->shape, kind->order);
    std::vector<std::int64_t>* set = nullptr;
    if (const std::string name = upper(keyword.get("ELSET")); !name.empty()) set = &set_of(name, keyword.get("ELSET"));
    std::vector<std::int64_t> file, own(std::size_t(kind->nodes));
    std::int64_t label = 0;
    const std::string_view next = for_data([&](std::string_view line) {
      if (file.empty()) label = integer(next_field(line), "an element's number");
      while (!line.empty()) {
        const std::string_view field = next_field(line);
        if (field.empty() && line.empty()) break;
        file.push_back(integer(field, "an element's node"));
      }
      if (file.size() < own.size()) return;
      if (file.size() > own.size())
        scan_.fail("element " + std::to_string(label) + " has more nodes than its type " + type + " has");
      for (std::size_t i = 0; i < own.size(); ++i) own[std::size_t(place[i])] = file[i];
      file.clear();
      if (label < 1) scan_.fail("an element has the number " + std::to_string(label) + "; numbers begin with 1");
      allowance_.take(1, kTreeNode);
      by_number_[label] = builder_.add_element(kind->shape, kind->order, own, label);
      if (set != nullptr) add_to_set(*set, label);
    });
    if (!file.empty())
      scan_.fail("element " + std::to_string(label) + " has fewer nodes than its type " + type + " has");
    return next;
  }

  std::string_view set(const Keyword& keyword) {
    std::vector<std::int64_t>& own = set_of(upper(keyword.get("ELSET")), keyword.get("ELSET"));
    const bool ranges = keyword.parameters.contains("GENERATE");
    return for_data([&](std::string_view line) {
      if (ranges) {
        const std::int64_t first = integer(next_field(line), "an element's number");
        const std::int64_t last = integer(next_field(line), "an element's number");
        const std::string_view field = next_field(line);
        const std::int64_t step = field.empty() ? 1 : integer(field, "a step");
        if (step < 1 || first < 1) scan_.fail("a set has a range whose beginning or step is below 1");
        for (auto at = by_number_.lower_bound(first); at != by_number_.end() && at->first <= last; ++at)
          if ((at->first - first) % step == 0) add_to_set(own, at->first);
        return;
      }
      while (!line.empty()) {
        const std::string_view field = next_field(line);
        if (field.empty()) continue;
        if (const auto other = sets_.find(upper(field)); other != sets_.end()) {
          const std::vector<std::int64_t> members = other->second;
          for (const std::int64_t label : members) add_to_set(own, label);
        } else {
          add_to_set(own, integer(field, "an element's number or the name of a set"));
        }
      }
    });
  }

  /// A surface of faces of elements: "17, S3" or "name of a set, S3".
  std::string_view surface(const Keyword& keyword) {
    const std::string type = upper(keyword.get("TYPE")), name = keyword.get("NAME");
    if (!type.empty() && type != "ELEMENT") return for_data([](std::string_view) {});
    return for_data([&](std::string_view line) {
      const std::string_view of = next_field(line);
      const std::string face = upper(next_field(line));
      if (face.size() != 2 || face[0] != 'S' || face[1] < '1' || face[1] > '6') return;  // SPOS and the like
      const auto set = sets_.find(upper(of));
      std::vector<std::int64_t> members;
      if (set != sets_.end())
        members = set->second;
      else
        members = {integer(of, "an element's number or the name of a set")};
      for (const std::int64_t label : members) add_side(label, face[1] - '1', name);
    });
  }

  void add_side(std::int64_t label, int face, const std::string& name) {
    const auto found = by_number_.find(label);
    if (found == by_number_.end()) return;
    const Shape shape = builder_.shape(found->second);
    const auto sides = faces_of(Sides::Abaqus, shape);
    if (std::size_t(face) >= sides.size())
      scan_.fail("a surface has a side " + std::to_string(face + 1) + " of element " + std::to_string(label) +
                 ", which has fewer");
    const int facet = same_sides(sides, reference::info(shape).facets)[std::size_t(face)];
    builder_.put_into_group(builder_.add_side(found->second, facet), tag_of(upper(name), name));
  }

  // === Groups ============================================================================================

  std::vector<std::int64_t>& set_of(const std::string& key, const std::string& name) {
    tag_of(key, name);
    return sets_[key];
  }
  void add_to_set(std::vector<std::int64_t>& set, std::int64_t label) {
    allowance_.make_room(set, 1);
    set.push_back(label);
  }
  int tag_of(const std::string& key, const std::string& name) {
    const auto [at, is_new] = tags_.try_emplace(key, int(tags_.size()) + 1);
    if (!is_new) return at->second;
    allowance_.take(2, kTreeNode + key.size() + name.size());
    for (int dimension = 1; dimension <= 3; ++dimension) builder_.name_group(dimension, at->second, name);
    return at->second;
  }

  void put_into_groups() {
    for (const auto& [key, members] : sets_) {
      const int tag = tags_.at(key);
      for (const std::int64_t label : members)
        if (const auto found = by_number_.find(label); found != by_number_.end())
          builder_.put_into_group(found->second, tag);
    }
  }

  std::string_view bytes_;
  Scanner scan_;
  FileAllowance allowance_;
  MeshBuilder builder_;
  int parts_ = 0;
  bool in_assembly_ = false, in_instance_ = false;
  std::map<std::int64_t, std::size_t> by_number_;
  std::map<std::string, std::vector<std::int64_t>> sets_;  ///< By their names in capitals.
  std::map<std::string, int> tags_;
  std::map<std::string, std::int64_t> left_out_;  ///< Types of elements that were left out, and how many.
};

}  // namespace

bool begins_like_abaqus(std::string_view bytes) {
  constexpr std::array kFirst = {"*HEADING", "*NODE",    "*PART",     "*ASSEMBLY",
                                 "*ELEMENT", "*INCLUDE", "*PREPRINT", "*PARAMETER"};
  while (!bytes.empty()) {
    const std::string_view line = trimmed(bytes.substr(0, std::min(bytes.find('\n'), bytes.size())));
    if (!line.empty() && !line.starts_with("**")) {
      std::string_view rest = line;
      const std::string name = upper(next_field(rest));
      return std::find(kFirst.begin(), kFirst.end(), name) != kFirst.end();
    }
    bytes.remove_prefix(std::min(bytes.find('\n'), bytes.size() - 1) + 1);
  }
  return false;
}

Expected<MeshFile> read_abaqus(std::string_view bytes, const Team& team) {
  return MeshFile{Reading(bytes, team.stop()).take(), Format::Abaqus};
}

}  // namespace varimesh::formats
