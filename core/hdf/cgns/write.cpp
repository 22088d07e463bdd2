// Writes CGNS files.
#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <map>
#include <set>
#include <span>

#include "core/formats/common/group_names.h"
#include "core/formats/hdf5/notes.h"
#include "core/formats/numbering/cgns_order.h"
#include "core/hdf/cgns/cgns.h"
#include "core/hdf/library/writer.h"
#include "core/mesh/changes/serendipity_elements.h"

namespace varimesh::formats {

namespace {

using Dims = std::vector<std::int64_t>;

/// The names of the children of a node.
class Names {
 public:
  explicit Names(std::initializer_list<std::string> used) : used_(used) {}

  void add(const std::string& name) { used_.insert(name); }
  /// A name as CGNS takes it: at most 32 characters, without a slash, and unlike those before it.
  std::string free(std::string_view wanted) {
    std::string name(wanted.substr(0, kNameBytes));
    for (char& c : name)
      if (static_cast<unsigned char>(c) < ' ' || c == '/' || static_cast<unsigned char>(c) > 126) c = '_';
    if (name.empty() || name == "." || name == ".." || name.front() == ' ') name = "Group" + name.substr(0, 20);
    const std::string plain = name;
    while (!used_.insert(name).second) {
      // Names with the same beginning share their numbers, so that none of these is tried for each name.
      const std::string ending =
          "_" + std::to_string(next_.try_emplace(plain.substr(0, kStemBytes), 2).first->second++);
      name = plain.substr(0, kNameBytes - ending.size()) + ending;
    }
    return name;
  }

 private:
  static constexpr std::size_t kNameBytes = 32, kStemBytes = kNameBytes - 11;  // what is left beside the longest number

  std::set<std::string> used_;
  std::map<std::string, int> next_;  ///< By the beginning of the names.
};

/// The blocks in the order of the file: cells, then sides. Readers such as VTK's take a zone whose first elements are
/// points for a cloud of points, so smaller elements are left out.
std::vector<const ElementBlock*> file_order(const HighOrderMesh& mesh) {
  std::vector<const ElementBlock*> blocks;
  for (const int d : {mesh.dimension, mesh.dimension - 1})
    for (const ElementBlock& block : mesh.blocks)
      if (reference::info(block.shape).dimension == d) blocks.push_back(&block);
  return blocks;
}

class Writing {
 public:
  Writing(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team)
      : mesh_(mesh), team_(team), blocks_(file_order(mesh)), types_(cgns_types_of(mesh)), writer_(writer) {}

  void write() {
    root();
    const bool flat = mesh_.dimension == 2 && is_flat();
    const std::int32_t space = flat ? 2 : 3;
    node("/Base", "CGNSBase_t", "I4", {2}, std::vector<std::int32_t>{mesh_.dimension, space});
    node(kZone, "Zone_t", "I4", {3, 1},
         std::vector{std::int32_t(mesh_.node_count()), std::int32_t(mesh_.element_count(mesh_.dimension)), 0});
    text(std::string(kZone) + "/ZoneType", "ZoneType_t", "Unstructured");
    coordinates(space);
    elements();
    groups(mesh_.dimension - 1);
    groups(mesh_.dimension);
  }

 private:
  static constexpr const char* kZone = "/Base/Zone";

  bool is_flat() const {
    for (std::size_t i = 2; i < mesh_.coordinates.size(); i += 3)
      if (mesh_.coordinates[i] != 0) return false;
    return true;
  }

  static std::string padded(std::string_view text, std::size_t bytes) {
    std::string whole(text.substr(0, bytes));
    whole.resize(bytes, '\0');
    return whole;
  }

  void describe(const std::string& path, std::string_view name, std::string_view label, std::string_view type) {
    writer_.attribute(path, "name", "S33", {}, padded(name, 33));
    writer_.attribute(path, "label", "S33", {}, padded(label, 33));
    writer_.attribute(path, "type", "S3", {}, padded(type, 3));
  }

  /// The nodes of the file that describe it as such.
  void root() {
    describe("/", "HDF5 MotherNode", "Root Node of HDF5 File", "MT");
    writer_.array("/ format", "i1", Dims{15}, padded("IEEE_LITTLE_32", 15));
    writer_.array("/ hdf5version", "i1", Dims{33}, padded("HDF5 Version 1.10.8", 33));
    const std::vector<float> version{3.4F};
    empty("/CGNSLibraryVersion", "CGNSLibraryVersion_t", "R4");
    writer_.array("/CGNSLibraryVersion/ data", "f4", Dims{1}, hdf::bytes_of(version));
  }

  void empty(const std::string& path, std::string_view label, std::string_view type) {
    writer_.group(path);
    describe(path, path.substr(path.rfind('/') + 1), label, type);
    const std::vector<std::int32_t> flags{1};
    writer_.attribute(path, "flags", "i4", Dims{1}, hdf::bytes_of(flags));
  }

  void node(const std::string& path, std::string_view label, std::string_view type, const Dims& dims,
            const std::vector<std::int32_t>& values) {
    empty(path, label, type);
    writer_.array(path + "/ data", "i4", dims, hdf::bytes_of(values));
  }

  void text(const std::string& path, std::string_view label, std::string_view value) {
    empty(path, label, "C1");
    writer_.array(path + "/ data", "i1", Dims{std::int64_t(value.size())}, value);
  }

  void coordinates(std::int32_t space) {
    const std::string grid = std::string(kZone) + "/GridCoordinates";
    empty(grid, "GridCoordinates_t", "MT");
    constexpr std::array kNames = {"/CoordinateX", "/CoordinateY", "/CoordinateZ"};
    for (std::size_t k = 0; k < std::size_t(space); ++k) {
      const std::string path = grid + kNames[k];
      empty(path, "DataArray_t", "R8");
      writer_.array(path + "/ data", "f8", Dims{std::int64_t(mesh_.node_count())});
      hdf::write_rows<double>(writer_, path + "/ data", 0, mesh_.node_count(), 1, 1, team_,
                              [&](std::size_t begin, std::size_t end, double* to) {
                                for (std::size_t node = begin; node < end; ++node)
                                  *to++ = mesh_.coordinates[3 * node + k];
                              });
    }
  }

  /// A section for each run of blocks of one shape and order.
  void elements() {
    std::int32_t number = 0;
    int section = 0;
    for (std::size_t b = 0; b < blocks_.size();) {
      std::size_t end = b;
      std::int64_t count = 0;
      for (; end < blocks_.size() && blocks_[end]->shape == blocks_[b]->shape &&
             blocks_[end]->order == blocks_[b]->order && is_serendipity(*blocks_[end]) == is_serendipity(*blocks_[b]);
           ++end)
        count += std::int64_t(blocks_[end]->size());
      if (count > 0) write_section(b, end, ++section, number, count);
      number += std::int32_t(count);
      b = end;
    }
  }

  void write_section(std::size_t begin, std::size_t end, int section, std::int32_t before, std::int64_t count) {
    const ElementBlock& first = *blocks_[begin];
    std::string name(reference::info(first.shape).plural);
    name[0] = char(std::toupper(static_cast<unsigned char>(name[0])));
    name += "_" + std::to_string(section);
    in_zone_.add(name);
    const std::string path = std::string(kZone) + "/" + name;
    node(path, "Elements_t", "I4", {2}, {cgns_type(first), 0});
    node(path + "/ElementRange", "IndexRange_t", "I4", {2}, {before + 1, before + std::int32_t(count)});
    // Serendipity elements have the first nodes of complete ones.
    const std::span place(gmsh_nodes(NodeOrder::Cgns, first.shape, first.order).data(), nodes_per_element(first));
    const std::string data = path + "/ElementConnectivity/ data";
    empty(path + "/ElementConnectivity", "DataArray_t", "I4");
    writer_.array(data, "i4", Dims{count * std::int64_t(place.size())});
    std::int64_t row = 0;
    for (std::size_t b = begin; b < end; ++b) {
      const ElementBlock& block = *blocks_[b];
      hdf::write_rows<std::int32_t>(writer_, data, row, block.size(), place.size(), 1, team_,
                                    [&](std::size_t from, std::size_t until, std::int32_t* to) {
                                      for (std::size_t e = from; e < until; ++e)
                                        for (const int local : place)
                                          *to++ = block.nodes[e * place.size() + std::size_t(local)] + 1;
                                    });
      row += std::int64_t(block.size() * place.size());
    }
  }

  /// Boundary conditions for the groups of sides, subregions for the groups of cells.
  void groups(int dimension) {
    std::map<int, std::vector<std::int32_t>> members;  // by tag
    std::int32_t number = 0;
    for (const ElementBlock* block : blocks_) {
      const bool wanted = reference::info(block->shape).dimension == dimension;
      for (std::size_t e = 0; e < block->size(); ++e) {
        ++number;
        if (wanted)
          for (const int tag : block->physical) members[std::abs(tag)].push_back(number);
      }
    }
    const bool cells = dimension == mesh_.dimension;
    const std::string parent = cells ? kZone : std::string(kZone) + "/ZoneBC";
    if (!cells && !members.empty()) empty(parent, "ZoneBC_t", "MT");
    const auto names = group_names(mesh_, dimension);
    Names in_conditions({});
    for (const auto& [tag, numbers] : members) {
      const auto named = names.find(tag);
      const std::string name =
          named == names.end() ? (cells ? "Cells_" : "Sides_") + std::to_string(tag) : std::string(named->second);
      write_group(parent, cells, tag, name, numbers, cells ? in_zone_ : in_conditions);
    }
  }

  void write_group(const std::string& parent, bool cells, int tag, const std::string& whole,
                   const std::vector<std::int32_t>& numbers, Names& used) {
    const std::string name = used.free(whole), path = parent + "/" + name;
    if (cells)
      node(path, "ZoneSubRegion_t", "I4", {1}, {mesh_.dimension});
    else
      text(path, "BC_t", types_.contains(tag) ? types_[tag] : "UserDefined");
    const auto n = std::int64_t(numbers.size());
    if (std::int64_t(numbers.back()) - numbers.front() + 1 == n)
      node(path + "/PointRange", "IndexRange_t", "I4", {2, 1}, {numbers.front(), numbers.back()});
    else
      node(path + "/PointList", "IndexArray_t", "I4", {n, 1}, numbers);
    text(path + "/GridLocation", "GridLocation_t",
         cells                  ? "CellCenter"
         : mesh_.dimension == 3 ? "FaceCenter"
                                : "EdgeCenter");
    if (!cells) node(path + "/" + kCgnsOrdinal, "Ordinal_t", "I4", {1}, {tag});
    if (cells) {
      // SIDS gives a subregion no ordinal, but data of the user's.
      empty(path + "/" + kCgnsOrdinal, "UserDefinedData_t", "I4");
      writer_.array(path + "/" + kCgnsOrdinal + "/ data", "i4", Dims{1}, hdf::bytes_of(std::vector{std::int32_t(tag)}));
    }
    if (name != whole) text(path + "/" + kCgnsWholeName, "Descriptor_t", whole);
  }

  const HighOrderMesh& mesh_;
  const Team& team_;
  std::vector<const ElementBlock*> blocks_;
  std::map<int, std::string> types_;
  hdf::Writer& writer_;
  /// What the zone has. Its groups of cells have other names than its sections.
  Names in_zone_{"ZoneType", "GridCoordinates", "ZoneBC"};
};

}  // namespace

Expected<void> write_cgns(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team) {
  for (const ElementBlock& block : mesh.blocks)
    if (block.order > kMostCgnsOrder)
      return bad_option("CGNS has elements up to order " + std::to_string(kMostCgnsOrder) +
                        ", and the mesh has order " + std::to_string(block.order) +
                        "; write vtu or mfem, or lower the order to 4.");
  if (mesh.dimension < 2) return bad_option("CGNS files of VariMesh have meshes of dimension 2 and 3; write msh41.");
  Writing(mesh, writer, team).write();
  return {};
}

}  // namespace varimesh::formats
