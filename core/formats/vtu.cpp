// Writes VTK unstructured grids: appended raw data in zlib-compressed blocks.
// Format: "VTK XML Formats" in the VTK documentation. The version of the file is 1.0, the newest that meshio reads. In
// files below 2.1, the upright edges of Lagrange hexahedra have the order of VTK 8, which VTK 9 changes when it reads
// them.
#include "core/formats/vtu.h"

#include <zlib.h>

#include <Eigen/Core>
#include <bit>
#include <cstring>
#include <limits>
#include <set>
#include <utility>

#include "core/formats/buffered_output.h"
#include "core/formats/node_order.h"
#include "core/formats/xml/xml.h"
#include "core/reference/basis.h"
#include "core/reference/cache.h"

namespace varimesh::formats {

namespace {

// An array as the appended data contains it: a header of UInt64 and the compressed blocks. The header has the number of
// blocks, the bytes per block, the bytes of the last block if it is shorter, and the compressed bytes of each block.
class CompressedArray {
 public:
  explicit CompressedArray(const Team& team) : team_(team), block_(kBlock) {}

  template <class T>
  void put(T value) {
    if (used_ + sizeof(T) > kBlock) end_block();
    std::memcpy(block_.data() + used_, &value, sizeof(T));
    used_ += sizeof(T);
  }

  void finish() {
    last_ = used_;
    if (used_ > 0) end_block();
    compress();
    block_ = {};
  }

  // Adds up to three bytes, so that the array has `remainder` bytes more than a multiple of 4. They follow the end of
  // the last zlib stream, where nobody looks for data.
  void pad(std::size_t remainder) {
    if (sizes_.empty()) return;
    const std::size_t added = (4 + remainder - bytes() % 4) % 4;
    data_.append(added, '\0');
    sizes_.back() += added;
  }

  std::size_t bytes() const { return 8 * (3 + sizes_.size()) + data_.size(); }

  void write(BufferedOutput& out) const {
    const std::uint64_t partial = last_ == kBlock ? 0 : last_;
    std::vector<std::uint64_t> header{sizes_.size(), kBlock, partial};
    header.insert(header.end(), sizes_.begin(), sizes_.end());
    out.text({reinterpret_cast<const char*>(header.data()), 8 * header.size()});
    out.text(data_);
  }

 private:
  static constexpr std::size_t kBlock = std::size_t(1) << 18;  // a multiple of every T's size
  static constexpr std::size_t kBlocksPerThread = 4;           // that wait to be compressed at the same time

  void end_block() {
    block_.resize(used_);
    waiting_.push_back(std::exchange(block_, std::vector<char>(kBlock)));
    used_ = 0;
    if (waiting_.size() >= kBlocksPerThread * std::size_t(team_.threads())) compress();
  }

  void compress() {
    std::vector<std::string> compressed(waiting_.size());
    team_.for_each(std::int32_t(waiting_.size()), 1, [&](std::int32_t i) {
      const std::vector<char>& block = waiting_[std::size_t(i)];
      std::string& bytes = compressed[std::size_t(i)];
      uLongf size = compressBound(uLong(block.size()));
      bytes.resize(size);
      // Level 1, because coordinates hardly compress: higher levels take four times as long and save a few per cent.
      compress2(reinterpret_cast<Bytef*>(bytes.data()), &size, reinterpret_cast<const Bytef*>(block.data()),
                uLong(block.size()), 1);
      bytes.resize(size);
    });
    for (const std::string& bytes : compressed) {
      data_ += bytes;
      sizes_.push_back(bytes.size());
    }
    waiting_.clear();
  }

  const Team& team_;
  std::vector<char> block_;
  std::size_t used_ = 0, last_ = 0;
  std::vector<std::vector<char>> waiting_;
  std::string data_;
  std::vector<std::uint64_t> sizes_;
};

// An array of the file, with its data.
struct Array {
  std::string name;
  std::string type;
  int components;
  CompressedArray data;
};

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

// The arrays of the grid, filled in one pass over the cells.
class Grid {
 public:
  Grid(const HighOrderMesh& mesh, std::span<const CellField> fields, const Team& team);

  std::size_t points = 0, cells = 0;
  Array coordinates;
  std::array<Array, 3> topology;
  std::vector<Array> cell_data, field_data;

 private:
  void add_groups(const Team& team);
  void add_block(const ElementBlock& block);

  const HighOrderMesh& mesh_;
  std::int64_t offset_ = 0;
};

Grid::Grid(const HighOrderMesh& mesh, std::span<const CellField> fields, const Team& team)
    : points(mesh.node_count()),
      coordinates{"Points", "Float64", 3, CompressedArray(team)},
      topology{{{"connectivity", "Int64", 1, CompressedArray(team)},
                {"offsets", "Int64", 1, CompressedArray(team)},
                {"types", "UInt8", 1, CompressedArray(team)}}},
      mesh_(mesh) {
  for (double x : mesh.coordinates) coordinates.data.put(x);
  cell_data.push_back({"element", "Int64", 1, CompressedArray(team)});
  cell_data.push_back({"physical", "Int32", 1, CompressedArray(team)});
  cell_data.push_back({"gmsh:physical", "Int32", 1, CompressedArray(team)});
  cell_data.push_back({"gmsh:geometrical", "Int32", 1, CompressedArray(team)});
  cell_data.push_back({"dimension", "Int32", 1, CompressedArray(team)});
  for (int dimension : {mesh.dimension, mesh.dimension - 1})
    for (const ElementBlock* block : blocks_of(mesh, dimension)) add_block(*block);
  for (const CellField& field : fields) {
    cell_data.push_back({field.name, "Float64", 1, CompressedArray(team)});
    for (double value : field.values) cell_data.back().data.put(value);
    for (std::size_t face = field.values.size(); face < cells; ++face)
      cell_data.back().data.put(std::numeric_limits<double>::quiet_NaN());
  }
  add_groups(team);
  coordinates.data.finish();
  for (Array& array : topology) array.data.finish();
  for (Array& array : cell_data) array.data.finish();
  for (Array& array : field_data) array.data.finish();
  // meshio moves arrays to other offsets, which are multiples of 4, and confuses those with offsets of the file. So no
  // array but the first begins at a multiple of 4.
  for (Array& array : field_data) array.data.pad(0);
  coordinates.data.pad(0);
  for (Array& array : topology) array.data.pad(0);
  for (Array& array : cell_data) array.data.pad(0);
  (field_data.empty() ? coordinates : field_data.front()).data.pad(1);
}

// One field per named group: its tag and its dimension, as meshio has them. A name that two groups have is there once.
void Grid::add_groups(const Team& team) {
  std::set<std::string> names;
  for (const PhysicalGroup& group : mesh_.physical_groups) {
    if (!names.insert(group.name).second) continue;
    field_data.push_back({group.name, "Int32", 1, CompressedArray(team)});
    field_data.back().data.put(std::int32_t(group.tag));
    field_data.back().data.put(std::int32_t(group.dimension));
  }
}

void Grid::add_block(const ElementBlock& block) {
  const VtkCell cell = vtk_cell(block.shape, block.order);
  const auto stride = Eigen::Index(reference::node_count(block.shape, block.order));
  const bool adds = block.shape == Shape::Pyramid && block.order > 1;
  for (std::size_t e = 0; e < block.size(); ++e, ++cells) {
    const std::int32_t* nodes = block.nodes.data() + std::ptrdiff_t(e) * stride;
    if (adds) {
      Eigen::MatrixX3d x(stride, 3);
      for (Eigen::Index i = 0; i < stride; ++i)
        for (Eigen::Index k = 0; k < 3; ++k) x(i, k) = mesh_.coordinates[3 * std::size_t(nodes[i]) + std::size_t(k)];
      const Eigen::MatrixX3d y = vtk_added_points(block.order) * x;
      for (Eigen::Index i = 0; i < y.rows(); ++i)
        for (Eigen::Index k = 0; k < 3; ++k) coordinates.data.put(y(i, k));
    }
    for (int local : cell.nodes) topology[0].data.put(std::int64_t(local >= 0 ? nodes[local] : std::int64_t(points++)));
    offset_ += std::int64_t(cell.nodes.size());
    topology[1].data.put(offset_);
    topology[2].data.put(cell.type);
    cell_data[0].data.put(block.numbers[e]);
    const auto physical = std::int32_t(block.physical.empty() ? 0 : block.physical.front());
    cell_data[1].data.put(physical);
    cell_data[2].data.put(physical);
    cell_data[3].data.put(std::int32_t(block.entity));
    cell_data[4].data.put(std::int32_t(reference::info(block.shape).dimension));
  }
}

// === The file ============================================================================================

void declare(BufferedOutput& out, const Array& array, std::size_t& offset) {
  // One component is the default. meshio makes a column of an array for which it is said.
  const std::string components =
      array.components == 1 ? "" : " NumberOfComponents=\"" + std::to_string(array.components) + "\"";
  out.text("        <DataArray type=\"" + array.type + "\" Name=\"" + escaped_xml(array.name) + "\"" + components +
           " format=\"appended\" offset=\"" + std::to_string(offset) + "\"/>\n");
  offset += array.data.bytes();
}

// A field's values belong to the whole grid, so their number is given. meshio takes them as a list only if the number
// of components is not.
void declare_field(BufferedOutput& out, const Array& array, std::size_t& offset) {
  out.text("      <DataArray type=\"" + array.type + "\" Name=\"" + escaped_xml(array.name) +
           "\" NumberOfTuples=\"2\" format=\"appended\" offset=\"" + std::to_string(offset) + "\"/>\n");
  offset += array.data.bytes();
}

}  // namespace

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
  BufferedOutput out(sink);
  std::size_t offset = 0;
  out.text("<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"");
  out.text(std::endian::native == std::endian::little ? "LittleEndian" : "BigEndian");
  out.text("\" header_type=\"UInt64\" compressor=\"vtkZLibDataCompressor\">\n  <UnstructuredGrid>\n");
  if (!grid.field_data.empty()) {
    out.text("    <FieldData>\n");
    for (const Array& array : grid.field_data) declare_field(out, array, offset);
    out.text("    </FieldData>\n");
  }
  out.text("    <Piece NumberOfPoints=\"" + std::to_string(grid.points) + "\" NumberOfCells=\"" +
           std::to_string(grid.cells) + "\">\n      <Points>\n");
  declare(out, grid.coordinates, offset);
  out.text("      </Points>\n      <Cells>\n");
  for (const Array& array : grid.topology) declare(out, array, offset);
  out.text("      </Cells>\n      <CellData>\n");
  for (const Array& array : grid.cell_data) declare(out, array, offset);
  out.text("      </CellData>\n    </Piece>\n  </UnstructuredGrid>\n  <AppendedData encoding=\"raw\">\n_");
  for (const Array& array : grid.field_data) array.data.write(out);
  grid.coordinates.data.write(out);
  for (const Array& array : grid.topology) array.data.write(out);
  for (const Array& array : grid.cell_data) array.data.write(out);
  out.text("\n  </AppendedData>\n</VTKFile>\n");
  return out.finish();
}

}  // namespace varimesh::formats
