// Writes the HDF5 meshes of HOPR.
#include <algorithm>
#include <cstdlib>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "core/formats/hdf5/files.h"
#include "core/formats/hopr/hopr.h"
#include "core/formats/left_out.h"
#include "core/formats/node_order.h"
#include "core/formats/sides/neighbours.h"
#include "core/formats/sides/sides.h"
#include "core/mesh/connectivity.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

constexpr std::size_t kNameBytes = 255;
/// HOPR counts its elements by these types.
constexpr std::array<std::int32_t, 11> kTypes = {104, 204, 105, 115, 205, 106, 116, 206, 108, 118, 208};

int element_type(Shape shape, int order) {
  const int corners = reference::info(shape).vertices;
  return order > 1 ? 200 + corners : shape == Shape::Tetrahedron ? 104 : 110 + corners;
}

int side_type(int corners, int order) { return order > 1 ? 20 + corners : corners == 3 ? 3 : 14; }

/// The numbers of the nodes in the file: those of the mesh if they count the nodes that cells use, otherwise new ones.
std::vector<std::int32_t> node_numbers(const HighOrderMesh& mesh, std::int32_t& used) {
  std::vector<std::int32_t> number(mesh.node_count(), 0);
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == 3)
      for (const std::int32_t node : block.nodes) number[std::size_t(node)] = 1;
  used = 0;
  std::int64_t most = 0;
  for (std::size_t node = 0; node < number.size(); ++node) {
    if (number[node] == 0) continue;
    number[node] = ++used;
    most = std::max(most, mesh.node_numbers[node]);
  }
  if (most <= used)
    for (std::size_t node = 0; node < number.size(); ++node)
      if (number[node] > 0) number[node] = std::int32_t(mesh.node_numbers[node]);
  return number;
}

class Writing {
 public:
  Writing(const HighOrderMesh& mesh, const Team& team)
      : mesh_(mesh),
        cells_(mesh, 3),
        neighbours_(mesh, cells_, team),
        numbers_(node_numbers(mesh, used_)),
        writer_(std::int64_t(count_nodes()) * 40, team.stop()) {}

  Expected<void> write(const Sink& sink) {
    const std::int64_t nodes = count_nodes();
    if (neighbours_.crowded())
      return bad_option("HOPR's format has no place for a side that more than two elements share; write msh41.");
    if (nodes > std::numeric_limits<std::int32_t>::max())
      return bad_option("HOPR's format counts nodes with 32 bits, and the mesh has more in its elements; write msh41.");
    elements();
    all_nodes(nodes);
    sides();
    conditions();
    writer_.attribute("/", "Version", "f8", kOne, bytes_of(std::vector{1.0}));
    attribute("Ngeo", mesh_.order);
    attribute("nElems", std::int64_t(cells_.count()));
    attribute("nSides", std::int64_t(neighbours_.side_count()));
    attribute("nNodes", nodes);
    attribute("nUniqueSides", unique_sides_);
    attribute("nUniqueNodes", used_);
    attribute("nBCs", std::int64_t(neighbours_.groups().size()));
    return writer_.finish(sink);
  }

 private:
  static constexpr std::array<std::int64_t, 1> kOne = {1};

  std::int64_t count_nodes() const {
    std::int64_t count = 0;
    for (const Cells::Range& range : cells_.ranges()) count += std::int64_t(range.block->size() * range.stride);
    return count;
  }

  void attribute(const char* name, std::int64_t value) {
    writer_.attribute("/", name, "i4", kOne, bytes_of(std::vector{std::int32_t(value)}));
  }

  void elements() {
    const auto n = std::int64_t(cells_.count());
    writer_.array("/ElemInfo", "i4", std::array<std::int64_t, 2>{n, 6});
    Hdf5Rows<std::int32_t> rows(writer_, "/ElemInfo", 6);
    std::map<int, std::int32_t> counter;
    std::int32_t node = 0, side = 0;
    for (std::size_t cell = 0; cell < cells_.count(); ++cell) {
      const Cells::Range& range = cells_.range_of(cell);
      const int type = element_type(range.block->shape, mesh_.order);
      const auto sides = std::int32_t(cgns_sides(range.block->shape).size());
      const int zone = range.block->physical.empty() ? 0 : std::abs(range.block->physical.front());
      for (const int value : {type, zone, int(side), int(side + sides), int(node), int(node + int(range.stride))})
        rows.add(value);
      side += sides;
      node += std::int32_t(range.stride);
      ++counter[type];
    }
    rows.flush();
    std::vector<std::int32_t> counts;
    for (const std::int32_t type : kTypes) {
      counts.push_back(type);
      counts.push_back(counter[type]);
    }
    writer_.array("/ElemCounter", "i4", std::array<std::int64_t, 2>{std::int64_t(kTypes.size()), 2}, bytes_of(counts));
    writer_.array("/ElemWeight", "f8", std::array{n}, bytes_of(std::vector<double>(std::size_t(n), 1.0)));
  }

  void all_nodes(std::int64_t count) {
    writer_.array("/NodeCoords", "f8", std::array<std::int64_t, 2>{count, 3});
    writer_.array("/GlobalNodeIDs", "i4", std::array{count});
    writer_.array("/ElemBarycenters", "f8", std::array<std::int64_t, 2>{std::int64_t(cells_.count()), 3});
    Hdf5Rows<double> x(writer_, "/NodeCoords", 3), centres(writer_, "/ElemBarycenters", 3);
    Hdf5Rows<std::int32_t> ids(writer_, "/GlobalNodeIDs", 1);
    for (const Cells::Range& range : cells_.ranges()) {
      const std::vector<int>& place = gmsh_nodes(NodeOrder::Rows, range.block->shape, mesh_.order);
      const auto corners = std::size_t(reference::info(range.block->shape).vertices);
      for (std::size_t e = 0; e < range.block->size(); ++e) {
        const std::int32_t* nodes = range.block->nodes.data() + e * range.stride;
        for (const int local : place) {
          const auto node = std::size_t(nodes[local]);
          ids.add(numbers_[node]);
          for (std::size_t k = 0; k < 3; ++k) x.add(mesh_.coordinates[3 * node + k]);
        }
        for (std::size_t k = 0; k < 3; ++k) {
          double sum = 0;
          for (std::size_t v = 0; v < corners; ++v) sum += mesh_.coordinates[3 * std::size_t(nodes[v]) + k];
          centres.add(sum / double(corners));
        }
      }
    }
    x.flush();
    ids.flush();
    centres.flush();
  }

  void sides() {
    writer_.array("/SideInfo", "i4", std::array<std::int64_t, 2>{std::int64_t(neighbours_.side_count()), 5});
    Hdf5Rows<std::int32_t> rows(writer_, "/SideInfo", 5);
    std::vector<std::int32_t> id(neighbours_.side_count(), 0);  // by facet
    for (std::size_t cell = 0; cell < cells_.count(); ++cell) {
      const Shape shape = cells_.shape(cell);
      for (const CgnsSide& side : cgns_sides(shape)) {
        const SideNeighbour other = neighbours_.of(cell, side);
        std::int32_t& own = id[other.own_facet];
        const bool is_second = own != 0;
        if (!is_second) own = ++unique_sides_;
        // Two sides that are periodic images have one number too.
        if (other.cell >= 0) id[other.facet] = own;
        const std::int32_t signed_id = is_second ? -own : own;
        for (const std::int32_t value :
             {std::int32_t(side_type(side.corners, mesh_.order)), signed_id, std::int32_t(other.cell + 1),
              std::int32_t(10 * other.side + other.flip), std::int32_t(other.group)})
          rows.add(value);
      }
    }
    rows.flush();
  }

  void conditions() {
    const std::vector<SideGroup>& groups = neighbours_.groups();
    const auto remembered = hopr_conditions_of(mesh_);
    std::vector<std::int32_t> codes;
    std::string names;
    for (const SideGroup& group : groups) {
      std::string name = group.name.substr(0, kNameBytes);
      names += name + std::string(kNameBytes - name.size(), ' ');
      const auto found = remembered.find(group.tag);
      const HoprCondition own = group.periodic != 0 ? HoprCondition{kHoprPeriodic, 0, 0, group.periodic}
                                : group.inner       ? HoprCondition{kHoprInner, 0, 0, 0}
                                                    : HoprCondition{2, 0, 0, 0};
      for (const std::int32_t number : found == remembered.end() ? own : found->second) codes.push_back(number);
    }
    const auto n = std::int64_t(groups.size());
    writer_.array("/BCNames", "F" + std::to_string(kNameBytes), std::array{n}, names);
    writer_.array("/BCType", "i4", std::array<std::int64_t, 2>{n, 4}, bytes_of(codes));
  }

  const HighOrderMesh& mesh_;
  Cells cells_;
  SideNeighbours neighbours_;
  std::int32_t used_ = 0, unique_sides_ = 0;
  std::vector<std::int32_t> numbers_;
  Hdf5Writer writer_;
};

}  // namespace

Expected<void> write_hopr(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField>,
                          const Team& team) {
  if (mesh.dimension != 3)
    return bad_option("HOPR's format has solids only, and the mesh has dimension " + std::to_string(mesh.dimension) +
                      "; write msh41, which HOPR reads.");
  return written_hdf5([&] { return Writing(mesh, team).write(sink); });
}

std::string not_in_hopr(const HighOrderMesh& mesh) {
  if (mesh.dimension != 3) return "";  // which cannot be written
  LeftOut lost;
  lost.small_elements(mesh);
  lost.count(SideNeighbours(mesh, Cells(mesh, 3), Team(1)).stray(), "boundary element that is no side of an element",
             "boundary elements that are no sides of elements");
  std::int64_t next = 0;
  bool renumbers = false, named = false, second = false;
  for (const ElementBlock& block : mesh.blocks) {
    const int dimension = reference::info(block.shape).dimension;
    second = second || (dimension >= 2 && block.physical.size() > 1);
    if (dimension == 3)
      for (const std::int64_t number : block.numbers) renumbers = renumbers || number != ++next;
  }
  for (const PhysicalGroup& group : mesh.physical_groups)
    named = named || (group.dimension == 3 && !group.name.empty());
  std::int32_t used = 0;
  const std::vector<std::int32_t> numbers = node_numbers(mesh, used);
  for (std::size_t node = 0; node < numbers.size(); ++node)
    renumbers = renumbers || (numbers[node] > 0 && numbers[node] != mesh.node_numbers[node]);
  lost.count(std::int64_t(numbers.size()) - used, "node without a cell", "nodes without a cell");
  lost.add_if(named, "names of groups of cells");
  lost.add_if(second, "the second group of an element");
  lost.entities_and_partitions(mesh);
  lost.add_if(renumbers, "the numbers of nodes and elements");
  return lost.sentence("HOPR's format");
}

}  // namespace varimesh::formats
