// Reads CGNS files.
#include <algorithm>
#include <compare>
#include <cstdlib>
#include <map>
#include <set>

#include "core/formats/hdf5/notes.h"
#include "core/formats/numbering/cgns_order.h"
#include "core/hdf/cgns/blocks.h"
#include "core/hdf/cgns/cgns.h"
#include "core/hdf/cgns/tree.h"
#include "core/hdf/cgns/zones.h"

namespace varimesh::formats {

namespace {

using hdf5::Kind;

constexpr const char* kData = kCgnsData;

/// Consecutive elements of the file.
struct Section {
  std::int64_t first = 0, last = 0, type = 0;
  Hdf5Group node;
};

/// A boundary condition or a subregion, in the order of the file.
struct Group {
  int tag = 0;
  int dimension = 0;  ///< Of its elements.
};

/// An element or a node that a group lists. Elements count from 1, nodes from 0.
struct Member {
  std::int32_t number;
  std::int32_t group;
  friend auto operator<=>(const Member&, const Member&) = default;
};

class Reading {
 public:
  Reading(Hdf5Source& source, FileAllowance& allowance)
      : allowance_(allowance), root_(source, allowance, "/"), blocks_(mesh_, allowance) {}

  HighOrderMesh take() {
    std::vector<CgnsZone> zones = find_zones();
    for (CgnsZone& zone : zones) {
      if (zones.size() > 1) zone_tag_ = group_tag(mesh_.dimension, zone.name, 0);
      read_zone(zone);
    }
    if (zones.size() > 1) join_cgns_zones(zones, mesh_, allowance_);
    // The children of a node come in the order of their names.
    std::sort(mesh_.physical_groups.begin(), mesh_.physical_groups.end(), [](const auto& a, const auto& b) {
      return std::pair(a.dimension, a.tag) < std::pair(b.dimension, b.tag);
    });
    remember_cgns_types(mesh_, types_);
    return std::move(mesh_);
  }

 private:
  // === The zone and its nodes ==============================================================================

  std::vector<CgnsZone> find_zones() {
    const auto bases = cgns_children(root_, "CGNSBase_t");
    if (bases.size() != 1) root_.fail("", "has " + std::to_string(bases.size()) + " bases (CGNSBase_t), not one");
    const Hdf5Group& base = bases.front().second;
    const std::vector<std::int64_t> dimensions = base.integers(kData);
    if (dimensions.size() != 2 || dimensions[0] < 2 || dimensions[0] > 3 || dimensions[1] < dimensions[0] ||
        dimensions[1] > 3)
      base.fail(kData, "does not give dimensions 2 or 3 of cells and of space");
    mesh_.dimension = int(dimensions[0]);
    components_ = int(dimensions[1]);
    std::vector<CgnsZone> zones;
    for (auto& [name, zone] : cgns_children(base, "Zone_t")) {
      if (cgns_text(zone.group("ZoneType")) != "Unstructured")
        zone.fail("ZoneType", "is not Unstructured; write the zone as an unstructured one");
      zones.push_back({name, std::move(zone)});
    }
    if (zones.empty()) base.fail("", "has no zone (Zone_t)");
    return zones;
  }

  void read_zone(CgnsZone& zone) {
    zone.first_node = nodes_before_ = std::int64_t(mesh_.node_count());
    zone.first_element = elements_before_;
    sections_.clear();
    groups_.clear();
    elements_.clear();
    nodes_.clear();
    next_member_ = 0;
    last_ = run_end_ = 0;
    read_coordinates(zone.node);
    find_sections(zone.node);
    read_groups(zone.node);
    read_elements();
    zone.nodes = std::int64_t(mesh_.node_count()) - nodes_before_;
    zone.elements = last_;
    elements_before_ += last_;
    if (elements_before_ > kMostCells) root_.fail("", "has too many elements");
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
    if (nodes_before_ + nodes > kMostNodes) zone.fail(kData, "makes too many nodes");
    reserve_large(mesh_.coordinates, 3 * std::size_t(nodes_before_ + nodes));
    reserve_large(mesh_.node_numbers, std::size_t(nodes_before_ + nodes));
    mesh_.coordinates.resize(3 * std::size_t(nodes_before_ + nodes), 0.0);
    for (int k = 0; k < components_; ++k)
      grid.group(kNames[std::size_t(k)])
          .for_rows<double>(kData, 1, [&](std::int64_t first, std::int64_t count, const double* x) {
            for (std::int64_t i = 0; i < count; ++i) {
              check_cgns_coordinate(grid, kNames[std::size_t(k)], first + i, x[i]);
              mesh_.coordinates[std::size_t(3 * (nodes_before_ + first + i) + k)] = x[i];
            }
          });
    for (std::int64_t i = 0; i < nodes; ++i) mesh_.node_numbers.push_back(nodes_before_ + i + 1);
    mesh_.node_blocks = {{-1, 0, 0, std::int32_t(nodes_before_ + nodes)}};
  }

  // === Elements ============================================================================================

  void find_sections(const Hdf5Group& zone) {
    for (auto& [_, node] : cgns_children(zone, "Elements_t")) {
      const std::vector<std::int64_t> range = node.group("ElementRange").integers(kData);
      const std::vector<std::int64_t> data = node.integers(kData);
      if (range.size() != 2 || range[0] < 1 || range[1] < range[0] || range[1] > kMostCells)
        node.fail("ElementRange", "is no range of elements");
      if (data.empty()) node.fail(kData, "has no element type");
      sections_.push_back({range[0], range[1], data[0], std::move(node)});
    }
    std::sort(sections_.begin(), sections_.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    if (sections_.empty()) zone.fail("", "has no elements (Elements_t)");
    for (const Section& section : sections_) {
      if (section.first != last_ + 1) section.node.fail("ElementRange", "does not begin after the section before it");
      last_ = section.last;
    }
  }

  void read_elements() {
    for (std::size_t i = 0; i < sections_.size(); ++i) read_section(sections_[i], int(i) + 1);
  }

  void read_section(const Section& section, int entity) {
    if (section.type == kCgnsPolygons || section.type == kCgnsPolyhedra)
      section.node.fail(kData,
                        "has polygons or polyhedra, whose sides are flat; VariMesh takes elements by their nodes");
    const bool mixed = section.type == kCgnsMixed;
    CgnsType own = mixed ? CgnsType() : element(section, section.type);
    const Hdf5Group connectivity = section.node.group("ElementConnectivity");
    std::vector<std::int64_t> part;  // of an element whose other nodes come with the next rows
    std::size_t wanted = 0;          // nodes of the element that is being read
    std::int64_t next = section.first;
    connectivity.for_rows<std::int64_t>(kData, 1, [&](std::int64_t first, std::int64_t count, const std::int64_t* v) {
      for (std::int64_t i = 0; i < count;) {
        if (wanted == 0) {
          if (next > section.last) connectivity.fail(kData, "has more than the elements of its section", first + i);
          if (mixed) own = element(section, v[i++]);
          wanted = own.nodes;
        }
        if (const std::int64_t many = std::min(run_end_ - next, (count - i) / std::int64_t(wanted));
            many > 0 && part.empty()) {
          const std::int64_t values = many * std::int64_t(wanted);
          check_nodes(connectivity, v + i, std::size_t(values), first + i);
          add_alike(next, many, v + i);
          next += many;
          i += values;
          wanted = 0;
          continue;
        }
        const std::size_t got = std::min(wanted - part.size(), std::size_t(count - i));
        check_nodes(connectivity, v + i, got, first + i);
        const bool whole = got == wanted;
        if (!whole) part.insert(part.end(), v + i, v + i + got);
        if (whole || part.size() == wanted) {
          add_element(section, own, entity, next++, whole ? v + i : part.data());
          part.clear();
          wanted = 0;
        }
        i += std::int64_t(got);
      }
    });
    if (wanted != 0 || next != section.last + 1) connectivity.fail(kData, "has fewer than the elements of its section");
  }

  void check_nodes(const Hdf5Group& connectivity, const std::int64_t* nodes, std::size_t count,
                   std::int64_t row) const {
    const std::int64_t most = std::int64_t(mesh_.node_count()) - nodes_before_;
    bool is_wrong = false;
    for (std::size_t i = 0; i < count; ++i) is_wrong |= std::uint64_t(nodes[i] - 1) >= std::uint64_t(most);
    if (!is_wrong) return;
    const auto* wrong = std::find_if(nodes, nodes + count, [&](std::int64_t n) { return n < 1 || n > most; });
    const std::string fault = "refers to node " + std::to_string(*wrong);
    connectivity.fail(kData, fault + ", but the nodes are 1 to " + std::to_string(most), row + (wrong - nodes));
  }

  CgnsType element(const Section& section, std::int64_t type) const {
    const auto found = cgns_element(type);
    if (!found)
      section.node.fail(kData, "has elements of type " + std::to_string(type) +
                                   ", which VariMesh does not know; write elements with all nodes, such as HEXA_64 for "
                                   "HEXA_56");
    return *found;
  }

  /// Adds an element to the last block if it is like the elements there, otherwise to a new one.
  void add_element(const Section& section, const CgnsType& type, int section_number, std::int64_t number,
                   const std::int64_t* nodes) {
    allowance_.look();
    if (number < run_end_) return add_alike(number, 1, nodes);
    const int dimension = reference::info(type.shape).dimension, vertices = reference::info(type.shape).vertices;
    const std::size_t members = next_member_;
    find_tags(number, dimension, vertices, nodes);
    const int entity = tags_.empty() ? section_number : tags_.front();
    if (dimension > mesh_.dimension) root_.fail("", "has elements of more dimensions than its base says");
    if (dimension == mesh_.dimension) mesh_.order = type.order;
    const bool by_nodes = !nodes_.empty() && dimension == mesh_.dimension - 1;
    const std::size_t run = section.type == kCgnsMixed || by_nodes ? 1 : alike(section, members, number);
    run_end_ = number + std::int64_t(run);
    next_member_ += (run - 1) * (next_member_ - members);
    blocks_.begin(type, entity, tags_, run);
    add_alike(number, 1, nodes);
  }

  /// Adds elements that are of the last one's type and in its groups.
  void add_alike(std::int64_t number, std::int64_t count, const std::int64_t* nodes) {
    blocks_.add(elements_before_ + number, count, nodes, nodes_before_ - 1);
  }

  /// How many elements of the section from this one on are in the same groups, as far as groups list elements.
  std::size_t alike(const Section& section, std::size_t member, std::int64_t number) const {
    const std::size_t each = next_member_ - member;
    if (each == 0) {
      const std::int64_t end = member < elements_.size() ? elements_[member].number : section.last + 1;
      return std::size_t(std::min(end, section.last + 1) - number);
    }
    std::size_t run = 1;
    for (std::size_t m = next_member_; number + std::int64_t(run) <= section.last; ++run, m += each) {
      const std::int64_t other = number + std::int64_t(run);
      const auto is_alike = [&](std::size_t k) {
        return m + k < elements_.size() && elements_[m + k] == Member{std::int32_t(other), elements_[member + k].group};
      };
      for (std::size_t k = 0; k < each; ++k)
        if (!is_alike(k)) return run;
      if (m + each < elements_.size() && elements_[m + each].number == other) return run;
    }
    return run;
  }

  /// The tags of the groups that an element is in, in the order of the groups.
  void find_tags(std::int64_t number, int dimension, int vertices, const std::int64_t* nodes) {
    tags_.clear();
    found_.clear();
    for (; next_member_ < elements_.size() && elements_[next_member_].number == number; ++next_member_)
      if (groups_[std::size_t(elements_[next_member_].group)].dimension == dimension)
        found_.push_back(elements_[next_member_].group);
    if (!nodes_.empty() && dimension == mesh_.dimension - 1) {
      // A boundary condition that lists nodes has the elements with all their vertices in it.
      const auto lists = [&](std::int64_t node, std::int32_t group) {
        return std::binary_search(nodes_.begin(), nodes_.end(), Member{std::int32_t(node) - 1, group});
      };
      auto one = std::lower_bound(nodes_.begin(), nodes_.end(), Member{std::int32_t(nodes[0]) - 1, 0});
      for (; one != nodes_.end() && one->number == nodes[0] - 1; ++one)
        if (std::all_of(nodes + 1, nodes + vertices, [&](std::int64_t node) { return lists(node, one->group); }))
          found_.push_back(one->group);
      std::sort(found_.begin(), found_.end());
      found_.erase(std::unique(found_.begin(), found_.end()), found_.end());
    }
    const bool in_zone_group = zone_tag_ != 0 && dimension == mesh_.dimension;
    for (const std::int32_t group : found_) tags_.push_back(groups_[std::size_t(group)].tag);
    if (in_zone_group && std::find(tags_.begin(), tags_.end(), zone_tag_) == tags_.end()) tags_.push_back(zone_tag_);
  }

  // === Groups ==============================================================================================

  void read_groups(const Hdf5Group& zone) {
    for (const auto& [_, conditions] : cgns_children(zone, "ZoneBC_t"))
      for (const auto& [name, node] : cgns_children(conditions, "BC_t")) read_group(node, name, mesh_.dimension - 1);
    for (const auto& [name, node] : cgns_children(zone, "ZoneSubRegion_t")) {
      // Others are parts of boundary conditions, or have no points of their own.
      const bool has_points = node.find("PointRange") != nullptr || node.find("PointList") != nullptr;
      if (has_points && cgns_location(node) == "CellCenter") read_group(node, name, mesh_.dimension);
    }
    for (std::vector<Member>* list : {&elements_, &nodes_}) {
      if (!std::is_sorted(list->begin(), list->end())) std::sort(list->begin(), list->end());
      list->erase(std::unique(list->begin(), list->end()), list->end());
    }
  }

  /// The tag of the group with this name, which several zones may have. `wanted`: its tag, if it is free; 0: any.
  int group_tag(int dimension, const std::string& name, std::int64_t wanted) {
    const auto known = tags_by_name_.find({dimension, name});
    if (known != tags_by_name_.end() && zone_tag_ != 0) return known->second;
    std::set<int>& used = used_[dimension];
    int tag = wanted > 0 && wanted <= 1'000'000'000 ? int(wanted) : 0;
    if (tag == 0 || used.contains(tag)) tag = used.empty() ? 1 : *used.rbegin() + 1;
    used.insert(tag);
    allowance_.take(1, sizeof(PhysicalGroup) + 2 * name.size() + 2 * kTreeNode);
    mesh_.physical_groups.push_back({dimension, tag, name});
    tags_by_name_[{dimension, name}] = tag;
    return tag;
  }

  static std::int64_t ordinal_of(const Hdf5Group& node) {
    if (node.find(kCgnsOrdinal) == nullptr) return 0;
    const std::vector<std::int64_t> values = node.group(kCgnsOrdinal).integers(kData);
    return values.size() == 1 ? values[0] : 0;
  }

  void read_group(const Hdf5Group& node, const std::string& name, int dimension) {
    const bool renamed = node.find(kCgnsWholeName) != nullptr;
    const int tag = group_tag(dimension, renamed ? cgns_text(node.group(kCgnsWholeName)) : name, ordinal_of(node));
    if (dimension < mesh_.dimension && node.find(kData) != nullptr) {
      // Readers refuse a word that is no type.
      const std::string type = cgns_text(node);
      const bool is_word = type.size() <= 32 &&
                           std::all_of(type.begin(), type.end(), [](unsigned char c) { return std::isalnum(c) != 0; });
      allowance_.take(1, kTreeNode + sizeof(std::string));
      if (is_word && !type.empty()) types_[tag] = type;
    }
    allowance_.take(1, 2 * sizeof(Group));
    groups_.push_back({tag, dimension});
    const bool by_nodes = dimension < mesh_.dimension && cgns_location(node) == "Vertex";
    for (const char* list : {"PointRange", "ElementRange", "PointList", "ElementList"})
      if (node.find(list) != nullptr)
        read_list(node.group(list), std::string_view(list).ends_with("Range"),
                  by_nodes && std::string_view(list).starts_with("Point"));
  }

  /// Reads the nodes or elements that the last group lists.
  void read_list(const Hdf5Group& points, bool range, bool nodes) {
    std::vector<Member>& members = nodes ? nodes_ : elements_;
    const auto group = std::int32_t(groups_.size()) - 1;
    const std::int64_t most = nodes ? std::int64_t(mesh_.node_count()) - nodes_before_ : last_;
    std::int64_t before = 0;
    points.for_rows<std::int64_t>(kData, 0, [&](std::int64_t first, std::int64_t count, const std::int64_t* values) {
      const std::int64_t each = points.need(kData, Kind::Integers, false).columns();
      if (range && (first > 0 || count * each != 2 || values[1] < values[0])) points.fail(kData, "is no range");
      for (std::int64_t i = 0; i < count * each; ++i)
        if (values[i] < 1 || values[i] > most)
          points.fail(
              kData, "has the number " + std::to_string(values[i]) + ", but they go from 1 to " + std::to_string(most));
      allowance_.make_room(members, std::size_t(range ? values[1] - values[0] + 1 : count * each));
      const auto put = [&](std::int64_t number) {
        allowance_.look();
        members.push_back({std::int32_t(number) - (nodes ? 1 : 0), group});
      };
      if (range)
        for (std::int64_t number = values[0]; number <= values[1]; ++number) put(number);
      else
        std::for_each(values, values + count * each, put);
      before += count;
    });
    if (range && before == 0) points.fail(kData, "is no range");
  }

  FileAllowance& allowance_;
  Hdf5Group root_;
  HighOrderMesh mesh_;
  int components_ = 3;
  std::int64_t last_ = 0;                                // number of the zone's last element
  std::int64_t nodes_before_ = 0, elements_before_ = 0;  // of the zones before
  int zone_tag_ = 0;                                     // of the zone's cells; 0: there is one zone
  std::map<std::pair<int, std::string>, int> tags_by_name_;
  CgnsBlocks blocks_;
  std::vector<Section> sections_;
  std::vector<Group> groups_;
  std::vector<Member> elements_, nodes_;  // that groups list, sorted
  std::size_t next_member_ = 0;           // the first of elements_ that is not before run_end_
  std::int64_t run_end_ = 0;              // up to here, elements are of the last one's type and in its groups
  std::vector<std::int32_t> found_;       // groups of the element that is being read
  std::vector<int> tags_;                 // their tags
  std::map<int, std::set<int>> used_;     // tags, by dimension
  std::map<int, std::string> types_;      // of boundary conditions, by tag
};

}  // namespace

MeshFile read_cgns(Hdf5Source& source, FileAllowance& allowance) {
  return {Reading(source, allowance).take(), Format::Cgns};
}

}  // namespace varimesh::formats
