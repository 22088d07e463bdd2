// Reads CGNS files.
#include <algorithm>
#include <cstdlib>
#include <map>
#include <set>
#include <sstream>

#include "core/formats/cgns/cgns.h"
#include "core/formats/cgns/order.h"

namespace varimesh::formats {

namespace {

using hdf5::Kind;

constexpr const char* kData = " data";
constexpr const char* kTypes = "BoundaryConditionTypes";

/// The text of a node's data, which CGNS stores as numbers of one byte.
std::string text_of(const Hdf5Group& node) {
  std::string text;
  for (const std::int64_t c : node.integers(kData)) text += c >= 0 && c < ' ' ? ' ' : char(c);
  while (text.ends_with(' ')) text.pop_back();
  return text;
}

std::string label_of(const Hdf5Group& node) {
  if (node.find("label", true) == nullptr) return {};
  const auto texts = node.texts("label", true);
  return texts.empty() ? std::string() : texts.front();
}

/// The children with this label, with their names.
std::vector<std::pair<std::string, Hdf5Group>> children(const Hdf5Group& node, std::string_view label) {
  std::vector<std::pair<std::string, Hdf5Group>> found;
  for (const Hdf5Item& item : node.items()) {
    if (item.attribute || item.kind != Kind::Group) continue;
    Hdf5Group child = node.group(item.name);
    if (label_of(child) == label) found.emplace_back(item.name, std::move(child));
  }
  return found;
}

/// Consecutive elements of the file.
struct Section {
  std::string name;
  std::int64_t first = 0, last = 0, type = 0;
  Hdf5Group node;
};

class Reading {
 public:
  Reading(Hdf5Source& source, FileAllowance& allowance) : allowance_(allowance), root_(source, allowance, "/") {}

  HighOrderMesh take() {
    const Hdf5Group zone = find_zone();
    read_coordinates(zone);
    read_elements(zone);
    read_groups(zone);
    // The children of a node come in the order of their names.
    std::sort(mesh_.physical_groups.begin(), mesh_.physical_groups.end(), [](const auto& a, const auto& b) {
      return std::pair(a.dimension, a.tag) < std::pair(b.dimension, b.tag);
    });
    make_blocks();
    remember_cgns_types(mesh_, types_);
    return std::move(mesh_);
  }

 private:
  // === The zone and its nodes ==============================================================================

  Hdf5Group find_zone() {
    const auto bases = children(root_, "CGNSBase_t");
    if (bases.size() != 1) root_.fail("", "has " + std::to_string(bases.size()) + " bases (CGNSBase_t), not one");
    const Hdf5Group& base = bases.front().second;
    const std::vector<std::int64_t> dimensions = base.integers(kData);
    if (dimensions.size() != 2 || dimensions[0] < 2 || dimensions[0] > 3 || dimensions[1] < dimensions[0] ||
        dimensions[1] > 3)
      base.fail(kData, "does not give dimensions 2 or 3 of cells and of space");
    mesh_.dimension = int(dimensions[0]);
    components_ = int(dimensions[1]);
    auto zones = children(base, "Zone_t");
    if (zones.size() != 1)
      base.fail("", "has " + std::to_string(zones.size()) +
                        " zones (Zone_t), and VariMesh reads one; join the zones in the program that wrote the file");
    Hdf5Group zone = std::move(zones.front().second);
    if (text_of(zone.group("ZoneType")) != "Unstructured")
      zone.fail("ZoneType", "is not Unstructured; write the zone as an unstructured one");
    return zone;
  }

  void read_coordinates(const Hdf5Group& zone) {
    const std::vector<std::int64_t> sizes = zone.integers(kData);
    if (sizes.empty() || sizes[0] < 1 || sizes[0] > kMostNodes) zone.fail(kData, "has no number of nodes");
    const std::int64_t nodes = sizes[0];
    const Hdf5Group grid = zone.group("GridCoordinates");
    constexpr std::array kNames = {"CoordinateX", "CoordinateY", "CoordinateZ"};
    for (int k = 0; k < components_; ++k) {
      const Hdf5Group axis = grid.group(kNames[std::size_t(k)]);
      const Hdf5Item& item = axis.need(kData, Kind::Numbers, false);
      if (item.rows() != nodes || item.columns() != 1)
        axis.fail(kData, "has " + std::to_string(item.rows()) + " numbers, but the zone has " + std::to_string(nodes) +
                             " nodes");
    }
    allowance_.take(std::size_t(nodes), 3 * sizeof(double) + sizeof(std::int64_t));
    mesh_.coordinates.assign(3 * std::size_t(nodes), 0.0);
    for (int k = 0; k < components_; ++k)
      grid.group(kNames[std::size_t(k)])
          .for_rows<double>(kData, 1, [&](std::int64_t first, std::int64_t count, const double* x) {
            for (std::int64_t i = 0; i < count; ++i) mesh_.coordinates[std::size_t(3 * (first + i) + k)] = x[i];
          });
    for (std::int64_t i = 0; i < nodes; ++i) mesh_.node_numbers.push_back(i + 1);
    mesh_.node_blocks = {{-1, 0, 0, std::int32_t(nodes)}};
  }

  // === Elements ============================================================================================

  void read_elements(const Hdf5Group& zone) {
    std::vector<Section> sections;
    for (auto& [name, node] : children(zone, "Elements_t")) {
      const std::vector<std::int64_t> range = node.group("ElementRange").integers(kData);
      const std::vector<std::int64_t> data = node.integers(kData);
      if (range.size() != 2 || range[0] < 1 || range[1] < range[0] || range[1] > kMostCells)
        node.fail("ElementRange", "is no range of elements");
      if (data.empty()) node.fail(kData, "has no element type");
      sections.push_back({name, range[0], range[1], data[0], std::move(node)});
    }
    std::sort(sections.begin(), sections.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    if (sections.empty()) zone.fail("", "has no elements (Elements_t)");
    for (std::size_t i = 0; i < sections.size(); ++i) {
      const Section& section = sections[i];
      if (section.first != last_ + 1) section.node.fail("ElementRange", "does not begin after the section before it");
      last_ = section.last;
      read_section(section, int(i) + 1);
    }
  }

  void read_section(const Section& section, int entity) {
    if (section.type == kCgnsPolygons || section.type == kCgnsPolyhedra)
      section.node.fail(kData,
                        "has polygons or polyhedra, whose sides are flat; VariMesh takes elements by their nodes");
    const bool mixed = section.type == kCgnsMixed;
    if (!mixed) (void)element(section, section.type);
    const Hdf5Group connectivity = section.node.group("ElementConnectivity");
    std::int64_t left = 0;  // nodes of the element that is being read
    std::int64_t next = section.first;
    CgnsType own;
    const auto begin = [&](std::int64_t type, std::int64_t row) {
      if (next > section.last) connectivity.fail(kData, "has more than the elements of its section", row);
      ++next;
      own = element(section, type);
      left = reference::node_count(own.shape, own.order);
      elements_.push_back({own.shape, own.order, entity, std::int64_t(nodes_.size())});
    };
    make_room(nodes_, connectivity.need(kData, Kind::Integers, false).rows());
    make_room(elements_, section.last - section.first + 1);
    const auto nodes = std::int64_t(mesh_.node_count());
    connectivity.for_rows<std::int64_t>(kData, 1, [&](std::int64_t first, std::int64_t count, const std::int64_t* v) {
      for (std::int64_t i = 0; i < count; ++i) {
        if (left == 0) {
          begin(mixed ? v[i] : section.type, first + i);
          if (mixed) continue;
        }
        if (v[i] < 1 || v[i] > nodes)
          connectivity.fail(kData,
                            "refers to node " + std::to_string(v[i]) + ", but the nodes are 1 to " +
                                std::to_string(mesh_.node_count()),
                            first + i);
        nodes_.push_back(std::int32_t(v[i]) - 1);
        --left;
      }
    });
    if (left != 0 || next != section.last + 1) connectivity.fail(kData, "has fewer than the elements of its section");
  }

  /// Exactly as much as is needed if there is one section, and at least half more for others.
  template <class T>
  void make_room(std::vector<T>& values, std::int64_t more) {
    if (more <= 0) return;
    const std::size_t before = values.capacity(), size = values.size() + std::size_t(more);
    if (size <= before) return;
    const std::size_t room = before == 0 ? size : std::max(size, before + before / 2);
    allowance_.take(room, sizeof(T));  // a copy of what was there is counted too: it is in memory at the same time
    values.reserve(room);
  }

  CgnsType element(const Section& section, std::int64_t type) const {
    const auto found = cgns_element(type);
    if (!found)
      section.node.fail(kData,
                        "has elements of type " + std::to_string(type) +
                            ", which do not have all nodes of their order; write elements with all nodes, such as "
                            "HEXA_27 for HEXA_20");
    return *found;
  }

  // === Groups ==============================================================================================

  void read_groups(const Hdf5Group& zone) {
    for (const auto& [_, conditions] : children(zone, "ZoneBC_t"))
      for (const auto& [name, node] : children(conditions, "BC_t")) read_group(node, name, mesh_.dimension - 1);
    for (const auto& [name, node] : children(zone, "ZoneSubRegion_t")) {
      // Others are parts of boundary conditions, or have no points of their own.
      const bool has_points = node.find("PointRange") != nullptr || node.find("PointList") != nullptr;
      if (has_points && location(node) == "CellCenter") read_group(node, name, mesh_.dimension);
    }
  }

  static std::string location(const Hdf5Group& node) {
    return node.find("GridLocation") == nullptr ? "Vertex" : text_of(node.group("GridLocation"));
  }

  int tag_of(const Hdf5Group& node, int dimension) {
    std::set<int>& used = tags_[dimension];
    int tag = 0;
    if (node.find(kCgnsOrdinal) != nullptr) {
      const std::vector<std::int64_t> values = node.group(kCgnsOrdinal).integers(kData);
      if (values.size() == 1 && values[0] > 0 && values[0] <= 1'000'000'000) tag = int(values[0]);
    }
    if (tag == 0 || used.contains(tag)) tag = used.empty() ? 1 : *used.rbegin() + 1;
    used.insert(tag);
    return tag;
  }

  void read_group(const Hdf5Group& node, const std::string& name, int dimension) {
    const int tag = tag_of(node, dimension);
    if (dimension < mesh_.dimension && node.find(kData) != nullptr) {
      // Readers refuse a word that is no type.
      const std::string type = text_of(node);
      const bool is_word = type.size() <= 32 &&
                           std::all_of(type.begin(), type.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
      allowance_.take(1, kTreeNode + sizeof(std::string));
      if (is_word && !type.empty()) types_[tag] = type;
    }
    allowance_.take(1, sizeof(PhysicalGroup) + name.size() + kTreeNode);
    const bool renamed = node.find(kCgnsWholeName) != nullptr;
    mesh_.physical_groups.push_back({dimension, tag, renamed ? text_of(node.group(kCgnsWholeName)) : name});
    const bool by_nodes = dimension < mesh_.dimension && location(node) == "Vertex";
    std::vector<bool> marked(by_nodes ? mesh_.node_count() : 0, false);
    for (const char* list : {"PointRange", "ElementRange", "PointList", "ElementList"}) {
      if (node.find(list) == nullptr) continue;
      const bool range = std::string_view(list).ends_with("Range");
      const bool nodes = by_nodes && std::string_view(list).starts_with("Point");
      const Hdf5Group points = node.group(list);
      const std::vector<std::int64_t> values = points.integers(kData);
      if (range && (values.size() != 2 || values[1] < values[0])) points.fail(kData, "is no range");
      const std::int64_t most = nodes ? std::int64_t(mesh_.node_count()) : last_;
      for (const std::int64_t value : values)
        if (value < 1 || value > most)
          points.fail(kData,
                      "has the number " + std::to_string(value) + ", but they go from 1 to " + std::to_string(most));
      const auto put = [&](std::int64_t value) {
        if (nodes)
          marked[std::size_t(value) - 1] = true;
        else
          join(std::size_t(value) - 1, tag, dimension);
      };
      if (range)
        for (std::int64_t value = values[0]; value <= values[1]; ++value) put(value);
      else
        std::for_each(values.begin(), values.end(), put);
    }
    if (by_nodes) join_marked(marked, tag, dimension);
  }

  void join(std::size_t element, int tag, int dimension) {
    allowance_.look();
    if (reference::info(elements_[element].shape).dimension != dimension) return;
    allowance_.take(1, 2 * sizeof(Member));
    members_.push_back({std::int32_t(element), tag});
  }

  /// A boundary condition that lists nodes has the elements with all of their nodes in it.
  void join_marked(const std::vector<bool>& marked, int tag, int dimension) {
    for (std::size_t e = 0; e < elements_.size(); ++e) {
      if (e % 4096 == 0) allowance_.look();
      const Element& each = elements_[e];
      if (reference::info(each.shape).dimension != dimension) continue;
      const auto* nodes = nodes_.data() + each.nodes;
      if (std::all_of(nodes, nodes + reference::info(each.shape).vertices,
                      [&](std::int32_t node) { return marked[std::size_t(node)]; }))
        join(e, tag, dimension);
    }
  }

  // === Blocks ==============================================================================================

  /// Elements that are alike, one run after another.
  void make_blocks() {
    const auto by_element = [](const Member& a, const Member& b) { return a.element < b.element; };
    if (!std::is_sorted(members_.begin(), members_.end(), by_element))
      std::stable_sort(members_.begin(), members_.end(), by_element);
    std::size_t member = 0;  // the first of the element
    for (std::size_t begin = 0, end = 0; begin < elements_.size(); begin = end) {
      const Element& first = elements_[begin];
      std::vector<int> groups;
      for (std::size_t m = member; m < members_.size() && members_[m].element == std::int32_t(begin); ++m)
        groups.push_back(members_[m].tag);
      const auto is_alike = [&](std::size_t e) {
        const Element& each = elements_[e];
        if (each.shape != first.shape || each.order != first.order) return false;
        if (groups.empty() && each.section != first.section) return false;
        std::size_t m = member, tag = 0;
        for (; m < members_.size() && members_[m].element == std::int32_t(e); ++m, ++tag)
          if (tag == groups.size() || members_[m].tag != groups[tag]) return false;
        if (tag < groups.size()) return false;
        member = m;
        return true;
      };
      while (end < elements_.size() && is_alike(end)) ++end;
      const int dimension = reference::info(first.shape).dimension;
      if (dimension > mesh_.dimension) root_.fail("", "has elements of more dimensions than its base says");
      if (dimension == mesh_.dimension) mesh_.order = first.order;
      add(begin, end, groups.empty() ? first.section : groups.front(), groups);
    }
  }

  void add(std::size_t begin, std::size_t end, int entity, const std::vector<int>& groups) {
    std::vector<ElementBlock>& blocks = mesh_.blocks;
    const Element& first = elements_[begin];
    if (blocks.empty() || blocks.back().shape != first.shape || blocks.back().order != first.order ||
        blocks.back().entity != entity || blocks.back().physical != groups) {
      allowance_.take(1, sizeof(ElementBlock) + 2 * kAllocation);
      blocks.push_back({first.shape, first.order, entity, groups, {}, {}, {}, {}});
    }
    ElementBlock& block = blocks.back();
    const std::vector<int>& place = gmsh_nodes(NodeOrder::Cgns, first.shape, first.order);
    allowance_.take(end - begin, sizeof(std::int64_t) + sizeof(std::int32_t) * place.size());
    if (block.size() == 0) block.numbers.reserve(end - begin);
    for (std::size_t e = begin; e < end; ++e) block.numbers.push_back(std::int64_t(e) + 1);
    std::size_t to = block.nodes.size();
    block.nodes.resize(to + (end - begin) * place.size());
    for (std::size_t e = begin; e < end; ++e, to += place.size())
      for (std::size_t i = 0; i < place.size(); ++i)
        block.nodes[to + std::size_t(place[i])] = nodes_[std::size_t(elements_[e].nodes) + i];
  }

  /// An element of a group.
  struct Member {
    std::int32_t element;  // counted from 0
    std::int32_t tag;
  };

  struct Element {
    Shape shape;
    int order;
    int section;         // counted from 1
    std::int64_t nodes;  // where its nodes begin
  };

  FileAllowance& allowance_;
  Hdf5Group root_;
  HighOrderMesh mesh_;
  int components_ = 3;
  std::int64_t last_ = 0;  // number of the last element so far
  std::vector<Element> elements_;
  std::vector<std::int32_t> nodes_;
  std::vector<Member> members_;        // of all groups
  std::map<int, std::set<int>> tags_;  // by dimension
  std::map<int, std::string> types_;   // of boundary conditions, by tag
};

}  // namespace

bool is_cgns(const Hdf5Group& root) {
  return root.find("CGNSLibraryVersion") != nullptr || root.find(" hdf5version") != nullptr;
}

void remember_cgns_types(HighOrderMesh& mesh, const std::map<int, std::string>& types) {
  if (types.empty()) return;
  std::string text;
  for (const auto& [tag, type] : types) text += std::to_string(tag) + " " + type + "\n";
  mesh.foreign.push_back({kTypes, text, "cgns"});
}

std::map<int, std::string> cgns_types_of(const HighOrderMesh& mesh) {
  std::map<int, std::string> types;
  for (const ForeignSection& section : mesh.foreign) {
    if (section.name != kTypes || section.format != "cgns") continue;
    std::istringstream text(section.bytes);
    std::string type;
    for (int tag = 0; text >> tag >> type;) types[tag] = type;
  }
  return types;
}

MeshFile read_cgns(Hdf5Source& source, FileAllowance& allowance) {
  return {Reading(source, allowance).take(), Format::Cgns};
}

}  // namespace varimesh::formats
