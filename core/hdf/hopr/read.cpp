// Reads the HDF5 meshes of HOPR.
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "core/formats/hdf5/notes.h"
#include "core/formats/numbering/node_order.h"
#include "core/formats/numbering/sides.h"
#include "core/hdf/hopr/hopr.h"
#include "core/mesh/connectivity.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

constexpr const char* kMortars =
    "has sides with hanging nodes (mortars), and VariMesh optimises conforming meshes only";

/// The shape of an element type: its last digit counts the corners.
bool shape_of(std::int64_t type, Shape& shape) {
  if (type < 100 || type > 299) return false;
  switch (type % 10) {
    case 4:
      shape = Shape::Tetrahedron;
      return true;
    case 5:
      shape = Shape::Pyramid;
      return true;
    case 6:
      shape = Shape::Prism;
      return true;
    case 8:
      shape = Shape::Hexahedron;
      return true;
    default:
      return false;
  }
}

class Reading {
 public:
  Reading(Hdf5Source& source, FileAllowance& allowance) : allowance_(allowance), root_(source, allowance, "/") {}

  HighOrderMesh take() {
    const std::int64_t order = root_.attribute("Ngeo");
    if (order < 1 || order > kMaxOrder)
      root_.fail("Ngeo",
                 "is " + std::to_string(order) + "; VariMesh takes orders from 1 to " + std::to_string(kMaxOrder));
    mesh_.dimension = 3;
    mesh_.order = int(order);
    read_elements();
    read_nodes();
    read_conditions();
    read_sides();
    std::move(sides_.begin(), sides_.end(), std::back_inserter(mesh_.blocks));
    return std::move(mesh_);
  }

 private:
  // === Elements and nodes ==================================================================================

  void read_elements() {
    const std::int64_t columns = root_.need("ElemInfo", hdf5::Kind::Integers, false).columns();
    if (columns < 6) root_.fail("ElemInfo", "has fewer than 6 values in a row");
    root_.for_rows<std::int64_t>("ElemInfo", 0, [&](std::int64_t first, std::int64_t count, const std::int64_t* rows) {
      for (std::int64_t i = 0; i < count; ++i) add_element(first + i, rows + i * columns);
    });
    if (mesh_.blocks.empty()) root_.fail("ElemInfo", "has no elements");
  }

  void add_element(std::int64_t row, const std::int64_t* values) {
    Shape shape{};
    if (!shape_of(values[0], shape))
      root_.fail("ElemInfo", "has the element type " + std::to_string(values[0]) + ", which HOPR does not know", row);
    const std::int64_t zone = values[1];
    if (zone < 0 || zone > std::numeric_limits<std::int32_t>::max())
      root_.fail("ElemInfo", "has the zone " + std::to_string(zone) + ", which is no number of a zone", row);
    const int nodes = reference::node_count(shape, mesh_.order);
    if (values[4] != node_rows_ || values[5] != node_rows_ + nodes)
      root_.fail("ElemInfo",
                 "gives an element too many or too few rows of nodes, or rows that do not follow the rows of the "
                 "element before it",
                 row);
    const auto sides = std::int64_t(cgns_sides(shape).size());
    if (values[3] - values[2] > sides) root_.fail("ElemInfo", kMortars, row);
    if (values[2] != side_rows_ || values[3] != side_rows_ + sides)
      root_.fail("ElemInfo",
                 "gives an element too many or too few rows of sides, or rows that do not follow the rows of the "
                 "element before it",
                 row);
    node_rows_ += nodes;
    side_rows_ += sides;
    if (node_rows_ > kMostNodes || row >= kMostCells) root_.fail("ElemInfo", "has too many elements");
    std::vector<ElementBlock>& blocks = mesh_.blocks;
    if (blocks.empty() || blocks.back().shape != shape || zones_.back() != zone) {
      allowance_.take(1, sizeof(ElementBlock) + 2 * kAllocation);
      blocks.push_back({shape, mesh_.order, int(std::max<std::int64_t>(1, zone)), {}, {}, {}, {}, {}});
      if (zone > 0) blocks.back().physical = {int(zone)};
      zones_.push_back(zone);
    }
    allowance_.take(1, sizeof(std::int64_t) + sizeof(std::int32_t) * std::size_t(nodes));
    blocks.back().numbers.push_back(row + 1);
  }

  /// Calls body(node) for the nodes of all cells in the order of the file. The nodes may still be numbers of the file.
  struct Cursor {
    std::vector<ElementBlock>* blocks;
    std::size_t block = 0, node = 0;
    std::int32_t& next() {
      while (node == (*blocks)[block].nodes.size()) {
        ++block;
        node = 0;
      }
      return (*blocks)[block].nodes[node++];
    }
  };

  void expect_rows(const char* name, hdf5::Kind kind, std::int64_t rows) const {
    const std::int64_t own = root_.need(name, kind, false).rows();
    if (own != rows)
      root_.fail(name, "has " + std::to_string(own) + " rows, but the elements have " + std::to_string(rows));
  }

  void read_nodes() {
    expect_rows("GlobalNodeIDs", hdf5::Kind::Integers, node_rows_);
    expect_rows("NodeCoords", hdf5::Kind::Numbers, node_rows_);
    for (ElementBlock& block : mesh_.blocks)
      block.nodes.resize(block.numbers.size() * std::size_t(reference::node_count(block.shape, mesh_.order)));
    std::int64_t most = 0;
    Cursor at{&mesh_.blocks};
    root_.for_rows<std::int64_t>(
        "GlobalNodeIDs", 1, [&](std::int64_t first, std::int64_t count, const std::int64_t* ids) {
          for (std::int64_t i = 0; i < count; ++i) {
            if (ids[i] < 1 || ids[i] > node_rows_)
              root_.fail("GlobalNodeIDs",
                         "has the number " + std::to_string(ids[i]) + ", but nodes are numbered 1 to " +
                             std::to_string(node_rows_) + " at most",
                         first + i);
            most = std::max(most, ids[i]);
            at.next() = std::int32_t(ids[i]) - 1;
          }
        });
    read_coordinates(std::size_t(most));
    drop_unused();
    for (ElementBlock& block : mesh_.blocks) sort_nodes(block);
  }

  void read_coordinates(std::size_t count) {
    allowance_.take(count, 3 * sizeof(double) + sizeof(std::int64_t) + 1);
    mesh_.coordinates.resize(3 * count);
    seen_.assign(count, false);
    double gap = 0, low = HUGE_VAL, high = -HUGE_VAL;
    std::int64_t gap_row = 0;
    Cursor at{&mesh_.blocks};
    root_.for_rows<double>("NodeCoords", 3, [&](std::int64_t first, std::int64_t rows, const double* x) {
      for (std::int64_t i = 0; i < rows; ++i) {
        const auto node = std::size_t(at.next());
        double* own = mesh_.coordinates.data() + 3 * node;
        for (int k = 0; k < 3; ++k) {
          const double value = x[3 * i + k];
          if (!std::isfinite(value))
            root_.fail("NodeCoords", "has a row in which node " + std::to_string(node + 1) + kNotFinite, first + i);
          low = std::min(low, value);
          high = std::max(high, value);
          if (!seen_[node]) own[k] = value;
          if (const double d = std::abs(own[k] - value); d > gap) {
            gap = d;
            gap_row = first + i;
          }
        }
        seen_[node] = true;
      }
    });
    // Copies of a node may differ by rounding.
    if (gap > 1e-9 * (high - low))
      root_.fail("NodeCoords", "has a node at another place than an earlier row with the same GlobalNodeIDs", gap_row);
  }

  /// Numbers that no element uses are left out.
  void drop_unused() {
    std::vector<std::int32_t> place(seen_.size(), -1);
    std::int32_t next = 0;
    for (std::size_t node = 0; node < seen_.size(); ++node) {
      if (!seen_[node]) continue;
      std::copy_n(mesh_.coordinates.begin() + std::ptrdiff_t(3 * node), 3,
                  mesh_.coordinates.begin() + std::ptrdiff_t(3 * std::size_t(next)));
      mesh_.node_numbers.push_back(std::int64_t(node) + 1);
      place[node] = next++;
    }
    mesh_.coordinates.resize(3 * std::size_t(next));
    mesh_.node_blocks = {{-1, 0, 0, next}};
    for (ElementBlock& block : mesh_.blocks)
      for (std::int32_t& node : block.nodes) node = place[std::size_t(node)];
  }

  void sort_nodes(ElementBlock& block) {
    const std::vector<int>& place = gmsh_nodes(NodeOrder::Rows, block.shape, mesh_.order);
    std::vector<std::int32_t> own(place.size());
    for (std::size_t e = 0; e < block.size(); ++e) {
      std::int32_t* nodes = block.nodes.data() + e * place.size();
      for (std::size_t i = 0; i < place.size(); ++i) own[std::size_t(place[i])] = nodes[i];
      std::copy(own.begin(), own.end(), nodes);
    }
  }

  // === Boundary conditions and sides =======================================================================

  void read_conditions() {
    const std::vector<std::string> names = root_.texts("BCNames");
    const std::vector<std::int64_t> codes = root_.integers("BCType");
    if (codes.size() != 4 * names.size())
      root_.fail("BCType", "has " + std::to_string(codes.size()) + " numbers, not four for each of the " +
                               std::to_string(names.size()) + " names in BCNames");
    std::map<int, HoprCondition> all;
    for (std::size_t i = 0; i < names.size(); ++i) {
      HoprCondition& condition = all[int(i) + 1];
      for (std::size_t k = 0; k < 4; ++k) {
        if (std::abs(codes[4 * i + k]) > 1'000'000'000) root_.fail("BCType", "has a number that is too large");
        condition[k] = std::int32_t(codes[4 * i + k]);
      }
      conditions_.push_back(condition);
      mesh_.physical_groups.push_back({2, int(i) + 1, names[i]});
    }
    allowance_.take(names.size(), sizeof(PhysicalGroup) + kTreeNode);
    remember_hopr_conditions(mesh_, all);
  }

  void read_sides() {
    const std::int64_t columns = root_.need("SideInfo", hdf5::Kind::Integers, false).columns();
    if (columns < 5) root_.fail("SideInfo", "has fewer than 5 values in a row");
    expect_rows("SideInfo", hdf5::Kind::Integers, side_rows_);
    for (const ElementBlock& block : mesh_.blocks) cells_ += std::int64_t(block.size());
    const Cells cells(mesh_, 3);
    std::size_t cell = 0, side = 0;
    root_.for_rows<std::int64_t>("SideInfo", 0, [&](std::int64_t first, std::int64_t count, const std::int64_t* rows) {
      for (std::int64_t i = 0; i < count; ++i) {
        allowance_.look();
        read_side(cells, cell, side, first + i, rows + i * columns);
        if (++side == cgns_sides(cells.shape(cell)).size()) {
          side = 0;
          ++cell;
        }
      }
    });
    for (PeriodicLink& link : mesh_.periodic) {
      std::sort(link.nodes.begin(), link.nodes.end());
      link.nodes.erase(std::unique(link.nodes.begin(), link.nodes.end()), link.nodes.end());
    }
  }

  void read_side(const Cells& cells, std::size_t cell, std::size_t side, std::int64_t row, const std::int64_t* values) {
    const std::int64_t type = values[0], id = values[1], neighbour = values[2], place = values[3], group = values[4];
    if (type < 0 || neighbour < 0) root_.fail("SideInfo", kMortars, row);
    if (neighbour > std::int64_t(cells.count()))
      root_.fail("SideInfo",
                 "names the neighbour " + std::to_string(neighbour) + ", but the elements are 1 to " +
                     std::to_string(cells.count()),
                 row);
    if (group < 0 || group > std::int64_t(conditions_.size()))
      root_.fail("SideInfo",
                 "names the boundary condition " + std::to_string(group) + ", but they are 1 to " +
                     std::to_string(conditions_.size()),
                 row);
    if (group == 0 && neighbour == 0)
      root_.fail("SideInfo", "has a side with neither a neighbour nor a boundary condition", row);
    if (group == 0) return;
    const HoprCondition& condition = conditions_[std::size_t(group) - 1];
    const bool periodic = condition[0] == kHoprPeriodic && neighbour > 0;
    // Both neighbours have an inner side.
    if (neighbour > 0 && !periodic && id < 0) return;
    const CgnsSide& own = cgns_sides(cells.shape(cell))[side];
    add_side(own.corners == 3 ? Shape::Triangle : Shape::Quadrilateral, int(group), row,
             reference::facet_nodes(cells.shape(cell), mesh_.order, own.facet), cells.nodes(cell));
    if (periodic && condition[3] < 0) link(cells, cell, own, row, std::size_t(neighbour) - 1, place, int(group));
  }

  void add_side(Shape shape, int group, std::int64_t row, const std::vector<int>& local,
                std::span<const std::int32_t> nodes) {
    const auto found = std::find_if(sides_.begin(), sides_.end(), [&](const ElementBlock& block) {
      return block.shape == shape && block.entity == group;
    });
    ElementBlock& block = found != sides_.end() ? *found : sides_.emplace_back();
    if (block.size() == 0) {
      allowance_.take(1, sizeof(ElementBlock) + 2 * kAllocation);
      block.shape = shape;
      block.order = mesh_.order;
      block.entity = group;
      block.physical = {group};
    }
    allowance_.take(1, 2 * (sizeof(std::int64_t) + sizeof(std::int32_t) * local.size()));
    block.numbers.push_back(cells_and(row));
    for (const int node : local) block.nodes.push_back(nodes[std::size_t(node)]);
  }

  /// Numbers of boundary elements follow those of the cells.
  std::int64_t cells_and(std::int64_t row) const { return cells_ + row + 1; }

  /// The local node at i steps from `origin` to `first` and j steps to `second`, all three vertices of a side.
  auto positions(Shape shape, std::int8_t origin, std::int8_t first, std::int8_t second) const {
    const auto& lattice = reference::lattice(shape, mesh_.order);
    const auto at = [&](std::int8_t vertex) { return lattice[std::size_t(vertex)]; };
    return [=, o = at(origin), a = at(first), b = at(second), order = mesh_.order,
            &nodes = nodes_by_position(shape, mesh_.order)](int i, int j) {
      std::array<int, 3> x{};
      for (std::size_t k = 0; k < 3; ++k) x[k] = o[k] + (a[k] - o[k]) / order * i + (b[k] - o[k]) / order * j;
      return nodes[std::size_t(x[0] + (order + 1) * (x[1] + (order + 1) * x[2]))];
    };
  }

  /// Pairs the nodes of a side with those of the periodic side of the neighbour.
  void link(const Cells& cells, std::size_t cell, const CgnsSide& own, std::int64_t row, std::size_t neighbour,
            std::int64_t place, int group) {
    const auto sides = cgns_sides(cells.shape(neighbour));
    const std::int64_t side = place / 10, flip = place % 10;
    if (place < 0 || side < 1 || side > std::int64_t(sides.size()) ||
        sides[std::size_t(side) - 1].corners != own.corners || flip < 1 || flip > own.corners)
      root_.fail("SideInfo",
                 "has the side and orientation " + std::to_string(place) + " of a neighbour, which it has not", row);
    const CgnsSide& other = sides[std::size_t(side) - 1];
    const int n = own.corners, order = mesh_.order;
    const auto turned = [&](std::int64_t vertex) { return other.vertices[std::size_t((vertex + 2 * n) % n)]; };
    const auto from = positions(cells.shape(cell), own.vertices[0], own.vertices[1], own.vertices[std::size_t(n) - 1]);
    const auto to = positions(cells.shape(neighbour), turned(flip - 1), turned(flip - 2), turned(flip));
    const int master = opposite(group);
    auto found = std::find_if(mesh_.periodic.begin(), mesh_.periodic.end(),
                              [&](const PeriodicLink& each) { return each.entity == group; });
    if (found == mesh_.periodic.end()) {
      mesh_.periodic.push_back({2, group, master, {}, {}});
      found = mesh_.periodic.end() - 1;
    }
    const auto nodes = cells.nodes(cell), others = cells.nodes(neighbour);
    for (int j = 0; j <= order; ++j)
      for (int i = 0; i <= (n == 3 ? order - j : order); ++i) {
        allowance_.take(1, 2 * sizeof(std::pair<std::int32_t, std::int32_t>));
        found->nodes.emplace_back(nodes[std::size_t(from(i, j))], others[std::size_t(to(i, j))]);
      }
  }

  /// The boundary condition with the opposite periodic index; itself if there is none.
  int opposite(int group) const {
    const std::int32_t index = conditions_[std::size_t(group) - 1][3];
    for (std::size_t i = 0; i < conditions_.size(); ++i)
      if (conditions_[i][0] == kHoprPeriodic && conditions_[i][3] == -index) return int(i) + 1;
    return group;
  }

  FileAllowance& allowance_;
  Hdf5Group root_;
  HighOrderMesh mesh_;
  std::vector<ElementBlock> sides_;
  std::vector<std::int64_t> zones_;  // of the blocks
  std::vector<bool> seen_;
  std::vector<HoprCondition> conditions_;
  std::int64_t node_rows_ = 0, side_rows_ = 0;
  std::int64_t cells_ = 0;  // of all blocks, once the sides are read
};

}  // namespace

MeshFile read_hopr(Hdf5Source& source, FileAllowance& allowance) {
  return {Reading(source, allowance).take(), Format::Hopr};
}

}  // namespace varimesh::formats
