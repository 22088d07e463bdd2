// Writes VTK unstructured grids. vtu/written_arrays.h has the arrays.
// Format: "VTK XML Formats" in the VTK documentation. The version of the file is 1.0, the newest that meshio reads. In
// files below 2.1, the upright edges of Lagrange hexahedra have the order of VTK 8, which VTK 9 changes when it reads
// them.
#include "core/formats/vtu/write.h"

#include <Eigen/Core>
#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <set>
#include <utility>

#include "core/base/io/buffered_output.h"
#include "core/formats/common/left_out.h"
#include "core/formats/numbering/node_order.h"
#include "core/formats/vtu/boundary.h"
#include "core/formats/vtu/cells.h"
#include "core/formats/vtu/written_arrays.h"
#include "core/formats/xml/xml.h"
#include "core/mesh/changes/serendipity_elements.h"
#include "core/reference/basis.h"
#include "core/reference/cache.h"

namespace varimesh::formats {

namespace {

std::vector<const ElementBlock*> blocks_of(const HighOrderMesh& mesh, int dimension) {
  std::vector<const ElementBlock*> blocks;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == dimension && block.size() > 0) blocks.push_back(&block);
  return blocks;
}

// The additional points of a pyramid that is written as a hexahedron: the values of the pyramid's basis at the points
// of the hexahedron's lattice, collapsed towards the apex. One row per point.
Eigen::MatrixXd added_points(int order) {
  const VtkCell cell = vtk_cell(Shape::Pyramid, order);
  const Positions& positions = node_positions(NodeOrder::Vtk, Shape::Pyramid, order);
  std::vector<std::array<double, 3>> at;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (cell.nodes[i] >= 0) continue;
    const double shrink = 1 - double(positions[i][2]) / order;
    at.push_back({shrink * (2.0 * positions[i][0] / order - 1), shrink * (2.0 * positions[i][1] / order - 1),
                  2.0 * positions[i][2] / order - 1});
  }
  reference::Points points(Eigen::Index(at.size()), 3);
  for (std::size_t i = 0; i < at.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) points(Eigen::Index(i), Eigen::Index(k)) = at[i][k];
  return reference::basis_values(Shape::Pyramid, order, reference::NodeSet::Equispaced, 3, points);
}

// Whether the file has points for the cells of the block that the mesh has not.
bool adds_points(const ElementBlock& block) {
  return block.shape == Shape::Pyramid && block.order > 1 && !is_serendipity(block);
}

// VTK's cells of pyramids from this order on do not have all of the pyramid's nodes.
constexpr int kListedPyramids = 3;

// The arrays of the grid. Points and connectivity are made while they are written.
class Grid {
 public:
  Grid(const HighOrderMesh& mesh, std::span<const CellField> fields, const Team& team);

  void write(BufferedOutput& out) const;

  std::size_t points, cells = 0;
  StoredArray coordinates, connectivity;
  std::vector<CompressedArray> topology, cell_data, field_data;

 private:
  struct Sizes {
    std::size_t points, cells, nodes;
  };
  /// Whether points need numbers of 64 bits.
  bool are_many() const { return std::int64_t(points) > kMostNodes; }
  static Sizes sizes(const HighOrderMesh& mesh);
  static VtkCell cell_of(const HighOrderMesh& mesh, const ElementBlock& block) {
    return pieces_of(mesh, block) > 1 ? vtk_pieces(block.order) : vtk_cell(block);
  }
  VtkCell cell_of(const ElementBlock& block) const { return cell_of(mesh_, block); }
  Grid(const HighOrderMesh& mesh, std::span<const CellField> fields, const Team& team, Sizes sizes);

  CompressedArray make(const char* name, const char* type) const { return {team_, {name, type, 1}}; }
  void add_groups();
  void add_block(const ElementBlock& block);
  void list_pyramids();
  template <class Body>
  void for_blocks(const Body& body) const {
    for (const int dimension : {mesh_.dimension, mesh_.dimension - 1})
      for (const ElementBlock* block : blocks_of(mesh_, dimension)) body(*block);
  }
  template <class Put>
  void put_added_points(const ElementBlock& block, const Put& put) const;
  void write_plain(BufferedOutput& out) const;
  void write_with_added_points(BufferedOutput& out) const;

  /// The nodes of a block in the list of the nodes of all cells.
  struct Run {
    std::size_t first;  ///< Place of the first of them.
    const ElementBlock* block;
    std::vector<int> places;  ///< For each node of VTK's cell, which of the element's nodes it is.

    /// Puts those from `begin` to `end - 1` where `to` is, and returns what is behind them.
    char* put(std::size_t begin, std::size_t end, char* to) const {
      const std::size_t stride = nodes_per_element(*block);
      std::size_t element = begin / places.size(), k = begin % places.size();
      for (; begin < end; ++begin, to += sizeof(std::int32_t)) {
        std::memcpy(to, &block->nodes[element * stride + std::size_t(places[k])], sizeof(std::int32_t));
        if (++k < places.size()) continue;
        k = 0;
        ++element;
      }
      return to;
    }
    std::size_t size() const { return block->size() * places.size(); }
  };

  const HighOrderMesh& mesh_;
  const Team& team_;
  std::int64_t offset_ = 0;
};

Grid::Sizes Grid::sizes(const HighOrderMesh& mesh) {
  Sizes all{mesh.node_count(), 0, 0};
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension < mesh.dimension - 1) continue;
    const std::vector<int> nodes = cell_of(mesh, block).nodes;
    all.cells += block.size() * pieces_of(mesh, block);
    all.nodes += block.size() * nodes.size();
    all.points += block.size() * std::size_t(std::count(nodes.begin(), nodes.end(), -1));
  }
  return all;
}

Grid::Grid(const HighOrderMesh& mesh, std::span<const CellField> fields, const Team& team)
    : Grid(mesh, fields, team, sizes(mesh)) {}

Grid::Grid(const HighOrderMesh& mesh, std::span<const CellField> fields, const Team& team, Sizes sizes)
    : points(sizes.points),
      coordinates({"Points", "Float64", 3}, 3 * sizeof(double) * sizes.points),
      connectivity({"connectivity", are_many() ? "Int64" : "Int32", 1}, (are_many() ? 8 : 4) * sizes.nodes),
      mesh_(mesh),
      team_(team) {
  topology.push_back(make("offsets", "Int64"));
  topology.push_back(make("types", "UInt8"));
  cell_data.push_back(make("element", "Int64"));
  for (const char* name : {"physical", "gmsh:physical", "gmsh:geometrical", "dimension"})
    cell_data.push_back(make(name, "Int32"));
  for_blocks([&](const ElementBlock& block) { add_block(block); });
  const auto of_boundary = fields.empty() ? std::vector<std::int64_t>() : cells_of_boundary(mesh);
  for (const CellField& field : fields) {
    cell_data.push_back(make(field.name.c_str(), "Float64"));
    for (double value : field.values) cell_data.back().put(value);
    for (const std::int64_t cell : of_boundary)
      cell_data.back().put(cell < 0 ? std::numeric_limits<double>::quiet_NaN() : field.values[std::size_t(cell)]);
  }
  add_groups();
  list_pyramids();
  // meshio moves arrays to other offsets, which are multiples of 4, and confuses those with offsets of the file. So no
  // array but the first begins at a multiple of 4.
  coordinates.pad(field_data.empty() ? 1 : 0);
  connectivity.pad(0);
  for (std::vector<CompressedArray>* list : {&topology, &cell_data, &field_data})
    for (CompressedArray& array : *list) {
      array.finish();
      array.pad(list == &field_data && &array == &list->front() ? 1 : 0);
    }
}

// One field per named group: its tag and its dimension, as meshio has them. A name that two groups have is there once.
void Grid::add_groups() {
  std::set<std::string> names;
  for (const PhysicalGroup& group : mesh_.physical_groups) {
    if (!names.insert(group.name).second) continue;
    field_data.push_back(make(group.name.c_str(), "Int32"));
    field_data.back().put(std::int32_t(group.tag));
    field_data.back().put(std::int32_t(group.dimension));
  }
}

void Grid::list_pyramids() {
  bool first = true;
  for_blocks([&](const ElementBlock& block) {
    if (block.shape != Shape::Pyramid || block.order < kListedPyramids) return;
    if (std::exchange(first, false)) field_data.push_back(make(kVtkPyramids, "Int32"));
    for (const std::int32_t node : block.nodes) field_data.back().put(node);
  });
}

void Grid::add_block(const ElementBlock& block) {
  const VtkCell cell = cell_of(block);
  const auto physical = std::int32_t(block.physical.empty() ? 0 : block.physical.front());
  const std::int32_t numbers[] = {physical, physical, block.entity, reference::info(block.shape).dimension};
  const std::size_t pieces = pieces_of(mesh_, block);
  cells += block.size() * pieces;
  for (std::size_t i = 0; i < block.size() * pieces; ++i) {
    topology[0].put(offset_ += std::int64_t(cell.nodes.size() / pieces));
    topology[1].put(cell.type);
    cell_data[0].put(i % pieces == 0 ? block.numbers[i / pieces] : kNextPiece);
    for (std::size_t k = 0; k < 4; ++k) cell_data[k + 1].put(numbers[k]);
  }
}

template <class Put>
void Grid::put_added_points(const ElementBlock& block, const Put& put) const {
  const auto stride = Eigen::Index(reference::node_count(block.shape, block.order));
  const Eigen::MatrixXd& added = vtk_added_points(block.order);
  Eigen::MatrixX3d x(stride, 3), y(added.rows(), 3);
  for (std::size_t e = 0; e < block.size(); ++e) {
    const std::int32_t* nodes = block.nodes.data() + std::ptrdiff_t(e) * stride;
    for (Eigen::Index i = 0; i < stride; ++i)
      for (Eigen::Index k = 0; k < 3; ++k) x(i, k) = mesh_.coordinates[3 * std::size_t(nodes[i]) + std::size_t(k)];
    y.noalias() = added * x;
    for (Eigen::Index i = 0; i < y.rows(); ++i)
      for (Eigen::Index k = 0; k < 3; ++k) put(y(i, k));
  }
}

void Grid::write(BufferedOutput& out) const {
  for (const CompressedArray& array : field_data) array.write(out);
  if (points == mesh_.node_count() && !are_many()) {
    write_plain(out);
  } else {
    write_with_added_points(out);
  }
  for (const CompressedArray& array : topology) array.write(out);
  for (const CompressedArray& array : cell_data) array.write(out);
}

/// If the file has the points of the mesh only.
void Grid::write_plain(BufferedOutput& out) const {
  coordinates.write_shared(out, [&](std::size_t begin, std::size_t end, char* to) {
    std::memcpy(to, reinterpret_cast<const char*>(mesh_.coordinates.data()) + begin, end - begin);
  });
  std::vector<Run> runs;
  std::size_t first = 0;
  for_blocks([&](const ElementBlock& block) {
    runs.push_back({first, &block, cell_of(block).nodes});
    first += runs.back().size();
  });
  connectivity.write_shared(out, [&](std::size_t begin, std::size_t end, char* to) {
    begin /= sizeof(std::int32_t);
    end /= sizeof(std::int32_t);
    const auto after = [](std::size_t at, const Run& run) { return at < run.first; };
    auto run = std::prev(std::upper_bound(runs.begin(), runs.end(), begin, after));
    for (; begin < end; ++run) {
      const std::size_t last = std::min(end, run->first + run->size());
      to = run->put(begin - run->first, last - run->first, to);
      begin = last;
    }
  });
}

void Grid::write_with_added_points(BufferedOutput& out) const {
  coordinates.write(out, [&](const auto& put) {
    for (const double x : mesh_.coordinates) put(x);
    for_blocks([&](const ElementBlock& block) {
      if (adds_points(block)) put_added_points(block, put);
    });
  });
  connectivity.write(out, [&](const auto& put) {
    const auto put_point = [&](std::int64_t point) { are_many() ? put(point) : put(std::int32_t(point)); };
    auto next = std::int64_t(mesh_.node_count());  // of the points that are added
    for_blocks([&](const ElementBlock& block) {
      const std::vector<int> cell = cell_of(block).nodes;
      const std::size_t stride = nodes_per_element(block);
      for (std::size_t e = 0; e < block.size(); ++e)
        for (const int local : cell)
          put_point(local >= 0 ? std::int64_t(block.nodes[e * stride + std::size_t(local)]) : next++);
    });
  });
}

// === The file ============================================================================================

template <class Array>
void declare(BufferedOutput& out, const Array& array, std::size_t& offset) {
  // One component is the default. meshio makes a column of an array for which it is said.
  const int count = array.name.components;
  const std::string components = count == 1 ? "" : " NumberOfComponents=\"" + std::to_string(count) + "\"";
  out.text("        <DataArray type=\"" + array.name.type + "\" Name=\"" + escaped_xml(array.name.name) + "\"" +
           components + " format=\"appended\" offset=\"" + std::to_string(offset) + "\"/>\n");
  offset += array.bytes();
}

// A field's values belong to the whole grid, so their number is given. meshio takes them as a list only if the number
// of components is not.
void declare_field(BufferedOutput& out, const CompressedArray& array, std::size_t& offset) {
  out.text("      <DataArray type=\"" + array.name.type + "\" Name=\"" + escaped_xml(array.name.name) +
           "\" NumberOfTuples=\"" + std::to_string(array.count()) + "\" format=\"appended\" offset=\"" +
           std::to_string(offset) + "\"/>\n");
  offset += array.bytes();
}

/// Whether two named groups have the same name.
bool share_names(const std::vector<PhysicalGroup>& groups) {
  std::set<std::string> names;
  return std::any_of(groups.begin(), groups.end(), [&](const PhysicalGroup& group) {
    return !group.name.empty() && !names.insert(group.name).second;
  });
}

}  // namespace

std::string not_in_vtu(const HighOrderMesh& mesh) {
  LeftOut lost;
  lost.small_elements(mesh);
  lost.add_if(std::any_of(mesh.blocks.begin(), mesh.blocks.end(),
                          [&](const ElementBlock& block) {
                            return block.physical.size() > 1 &&
                                   reference::info(block.shape).dimension >= mesh.dimension - 1;
                          }),
              "the second group of an element");
  lost.add_if(share_names(mesh.physical_groups), "a name that two groups have");
  lost.add_if(!mesh.periodic.empty(), "periodic links");
  lost.entities_and_partitions(mesh);
  std::int64_t next = 0;
  lost.add_if(std::any_of(mesh.node_numbers.begin(), mesh.node_numbers.end(),
                          [&](std::int64_t number) { return number != ++next; }),
              "the numbers of nodes");
  return lost.sentence("VTU's format");
}

const Eigen::MatrixXd& vtk_added_points(int order) {
  static reference::Cache<int, Eigen::MatrixXd> cache;
  return cache.get(order, [&] { return added_points(order); });
}

Expected<void> write_vtu(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField> fields,
                         const Team& team) {
  for (const CellField& field : fields)
    if (field.values.size() != mesh.element_count(mesh.dimension))
      return bad_option("The field '" + field.name + "' has " + std::to_string(field.values.size()) + " values for " +
                        std::to_string(mesh.element_count(mesh.dimension)) + " cells; give one value per cell.");
  const Grid grid(mesh, fields, team);
  BufferedOutput out(sink, false, team);
  std::size_t offset = 0;
  out.text("<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"");
  out.text(std::endian::native == std::endian::little ? "LittleEndian" : "BigEndian");
  out.text("\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n  <UnstructuredGrid>\n");
  if (!grid.field_data.empty()) {
    out.text("    <FieldData>\n");
    for (const CompressedArray& array : grid.field_data) declare_field(out, array, offset);
    out.text("    </FieldData>\n");
  }
  out.text("    <Piece NumberOfPoints=\"" + std::to_string(grid.points) + "\" NumberOfCells=\"" +
           std::to_string(grid.cells) + "\">\n      <Points>\n");
  declare(out, grid.coordinates, offset);
  out.text("      </Points>\n      <Cells>\n");
  declare(out, grid.connectivity, offset);
  for (const CompressedArray& array : grid.topology) declare(out, array, offset);
  // Viewers colour cells by the active scalars when they open the file.
  const std::string active = fields.empty() ? "" : " Scalars=\"" + escaped_xml(fields.front().name) + "\"";
  out.text("      </Cells>\n      <CellData" + active + ">\n");
  for (const CompressedArray& array : grid.cell_data) declare(out, array, offset);
  out.text("      </CellData>\n    </Piece>\n  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n_");
  grid.write(out);
  out.text("\n  </AppendedData>\n</VTKFile>\n");
  return out.finish();
}

}  // namespace varimesh::formats
