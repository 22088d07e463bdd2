// Writes the HDF5 meshes of HOPR.
#include <algorithm>
#include <cstdlib>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "core/formats/hdf5/hdf5.h"
#include "core/formats/hdf5/notes.h"
#include "core/formats/numbering/neighbours.h"
#include "core/formats/numbering/node_order.h"
#include "core/formats/numbering/sides.h"
#include "core/hdf/hopr/hopr.h"
#include "core/hdf/library/writer.h"
#include "core/mesh/connectivity.h"
#include "core/mesh/part_table.h"
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
  Writing(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team)
      : mesh_(mesh),
        team_(team),
        cells_(mesh, 3),
        neighbours_(mesh, cells_, team),
        numbers_(node_numbers(mesh, used_)),
        writer_(writer) {}

  Expected<void> write() {
    const std::int64_t nodes = count_nodes();
    if (auto two = check_two_at_sides(neighbours_.crowded(), kHoprName); !two) return two;
    if (nodes > std::numeric_limits<std::int32_t>::max())
      return bad_option("HOPR's format counts nodes with 32 bits, and the mesh has more in its elements; write msh41.");
    elements();
    all_nodes(nodes);
    sides();
    conditions();
    writer_.attribute("/", "Version", "f8", kOne, hdf::bytes_of(std::vector{1.0}));
    attribute("Ngeo", mesh_.order);
    attribute("nElems", std::int64_t(cells_.count()));
    attribute("nSides", std::int64_t(neighbours_.side_count()));
    attribute("nNodes", nodes);
    attribute("nUniqueSides", unique_sides_);
    attribute("nUniqueNodes", used_);
    attribute("nBCs", std::int64_t(neighbours_.groups().size()));
    return {};
  }

 private:
  static constexpr std::array<std::int64_t, 1> kOne = {1};

  std::int64_t count_nodes() const {
    std::int64_t count = 0;
    for (const Cells::Range& range : cells_.ranges()) count += std::int64_t(range.block->size() * range.stride);
    return count;
  }

  void attribute(const char* name, std::int64_t value) {
    writer_.attribute("/", name, "i4", kOne, hdf::bytes_of(std::vector{std::int32_t(value)}));
  }

  /// The sides of a cell of the range.
  static std::size_t sides_of(const Cells::Range& range) { return cgns_sides(range.block->shape).size(); }

  /// Calls body(range, first row of its nodes, first row of its sides).
  template <class Body>
  void for_ranges(const Body& body) const {
    std::int64_t node = 0, side = 0;
    for (const Cells::Range& range : cells_.ranges()) {
      body(range, node, side);
      node += std::int64_t(range.block->size() * range.stride);
      side += std::int64_t(range.block->size() * sides_of(range));
    }
  }

  void elements() {
    const auto n = std::int64_t(cells_.count());
    writer_.array("/ElemInfo", "i4", std::array<std::int64_t, 2>{n, 6});
    std::map<int, std::int32_t> counter;
    for_ranges([&](const Cells::Range& range, std::int64_t node, std::int64_t side) {
      const int type = element_type(range.block->shape, mesh_.order);
      const int zone = range.block->physical.empty() ? 0 : std::abs(range.block->physical.front());
      const auto nodes = std::int64_t(range.stride), sides = std::int64_t(sides_of(range));
      counter[type] += std::int32_t(range.block->size());
      hdf::write_rows<std::int32_t>(
          writer_, "/ElemInfo", std::int64_t(range.first), range.block->size(), 1, 6, team_,
          [&](std::size_t begin, std::size_t end, std::int32_t* to) {
            for (auto e = std::int64_t(begin); e < std::int64_t(end); ++e)
              for (const std::int64_t value : {std::int64_t(type), std::int64_t(zone), side + e * sides,
                                               side + (e + 1) * sides, node + e * nodes, node + (e + 1) * nodes})
                *to++ = std::int32_t(value);
          });
    });
    std::vector<std::int32_t> counts;
    for (const std::int32_t type : kTypes) {
      counts.push_back(type);
      counts.push_back(counter[type]);
    }
    writer_.array("/ElemCounter", "i4", std::array<std::int64_t, 2>{std::int64_t(kTypes.size()), 2},
                  hdf::bytes_of(counts));
    writer_.array("/ElemWeight", "f8", std::array{n});
    hdf::write_rows<double>(writer_, "/ElemWeight", 0, cells_.count(), 1, 1, team_,
                            [](std::size_t begin, std::size_t end, double* to) { std::fill_n(to, end - begin, 1.0); });
  }

  void all_nodes(std::int64_t count) {
    writer_.array("/NodeCoords", "f8", std::array<std::int64_t, 2>{count, 3});
    writer_.array("/GlobalNodeIDs", "i4", std::array{count});
    writer_.array("/ElemBarycenters", "f8", std::array<std::int64_t, 2>{std::int64_t(cells_.count()), 3});
    for_ranges([&](const Cells::Range& range, std::int64_t first, std::int64_t) {
      const std::vector<int>& place = gmsh_nodes(NodeOrder::Rows, range.block->shape, mesh_.order);
      const auto corners = std::size_t(reference::info(range.block->shape).vertices);
      const std::size_t cells = range.block->size();
      const auto for_cells = [&](std::size_t begin, std::size_t end, const auto& body) {
        for (std::size_t e = begin; e < end; ++e) body(range.block->nodes.data() + e * range.stride);
      };
      hdf::write_rows<double>(writer_, "/NodeCoords", first, cells, range.stride, 3, team_,
                              [&](std::size_t begin, std::size_t end, double* to) {
                                for_cells(begin, end, [&](const std::int32_t* nodes) {
                                  for (const int local : place) to = std::copy_n(at(nodes[local]), 3, to);
                                });
                              });
      hdf::write_rows<std::int32_t>(writer_, "/GlobalNodeIDs", first, cells, range.stride, 1, team_,
                                    [&](std::size_t begin, std::size_t end, std::int32_t* to) {
                                      for_cells(begin, end, [&](const std::int32_t* nodes) {
                                        for (const int local : place) *to++ = numbers_[std::size_t(nodes[local])];
                                      });
                                    });
      hdf::write_rows<double>(writer_, "/ElemBarycenters", std::int64_t(range.first), cells, 1, 3, team_,
                              [&](std::size_t begin, std::size_t end, double* to) {
                                for_cells(begin, end, [&](const std::int32_t* nodes) {
                                  for (std::size_t k = 0; k < 3; ++k) {
                                    double sum = 0;
                                    for (std::size_t v = 0; v < corners; ++v) sum += at(nodes[v])[k];
                                    *to++ = sum / double(corners);
                                  }
                                });
                              });
    });
  }

  const double* at(std::int32_t node) const { return mesh_.coordinates.data() + 3 * std::size_t(node); }

  /// Marks the rows of the sides that get a number of their own. Two neighbours share the number of their side, and so
  /// do two sides that are periodic images.
  RankedMarks first_sides() {
    RankedMarks marks(neighbours_.side_count());
    for_ranges([&](const Cells::Range& range, std::int64_t, std::int64_t first) {
      const auto all = cgns_sides(range.block->shape);
      auto row = std::size_t(first);  // and the first facet of the cell
      for (std::size_t e = 0; e < range.block->size(); ++e, row += all.size())
        for (std::size_t k = 0; k < all.size(); ++k) {
          const std::size_t own = row + std::size_t(all[k].facet);
          const std::int64_t other = neighbours_.other_facet(own);
          if (other < 0 || std::size_t(other) > own) marks.mark(row + k);
        }
    });
    unique_sides_ = std::int32_t(marks.finish());
    return marks;
  }

  void sides() {
    writer_.array("/SideInfo", "i4", std::array<std::int64_t, 2>{std::int64_t(neighbours_.side_count()), 5});
    const RankedMarks firsts = first_sides();
    // Negative for the second of two neighbours.
    const auto number = [&](std::size_t row, const SideNeighbour& other) {
      if (firsts.is_marked(row)) return std::int32_t(firsts.before(row)) + 1;
      const std::size_t its = neighbours_.first_facet(std::size_t(other.cell)) + std::size_t(other.side) - 1;
      return -std::int32_t(firsts.before(its)) - 1;
    };
    for_ranges([&](const Cells::Range& range, std::int64_t, std::int64_t first) {
      const auto all = cgns_sides(range.block->shape);
      hdf::write_rows<std::int32_t>(writer_, "/SideInfo", first, range.block->size(), all.size(), 5, team_,
                                    [&](std::size_t begin, std::size_t end, std::int32_t* to) {
                                      std::size_t row = std::size_t(first) + begin * all.size();
                                      for (std::size_t e = begin; e < end; ++e)
                                        for (const CgnsSide& side : all) {
                                          const SideNeighbour other = neighbours_.of(range.first + e, side);
                                          *to++ = side_type(side.corners, mesh_.order);
                                          *to++ = number(row++, other);
                                          *to++ = std::int32_t(other.cell + 1);
                                          *to++ = std::int32_t(10 * other.side + other.flip);
                                          *to++ = std::int32_t(other.group);
                                        }
                                    });
    });
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
    writer_.array("/BCType", "i4", std::array<std::int64_t, 2>{n, 4}, hdf::bytes_of(codes));
  }

  const HighOrderMesh& mesh_;
  const Team& team_;
  Cells cells_;
  SideNeighbours neighbours_;
  std::int32_t used_ = 0, unique_sides_ = 0;
  std::vector<std::int32_t> numbers_;
  hdf::Writer& writer_;
};

}  // namespace

Expected<void> write_hopr(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team) {
  if (mesh.dimension != 3)
    return bad_option("HOPR's format has solids only, and the mesh has dimension " + std::to_string(mesh.dimension) +
                      "; write msh41, which HOPR reads.");
  return Writing(mesh, writer, team).write();
}

}  // namespace varimesh::formats
