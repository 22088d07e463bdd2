// Writes MFEM's meshes.
#include <algorithm>
#include <cassert>
#include <charconv>
#include <cstdlib>
#include <optional>

#include "core/base/io/buffered_output.h"
#include "core/formats/common/left_out.h"
#include "core/formats/mfem/attributes.h"
#include "core/formats/mfem/mfem.h"
#include "core/formats/mfem/shared_sides.h"
#include "core/formats/mfem/topology.h"

namespace varimesh::formats {

namespace {

constexpr std::string_view kRemembered = "FiniteElementSpace";

bool has_dimension(const ElementBlock& block, int dimension) {
  return reference::info(block.shape).dimension == dimension;
}

// === The cells and their vertices ========================================================================

/// The vertices of the cells, numbered from 0 in the order of the nodes, and the edges and faces.
class Grid {
 public:
  Grid(const HighOrderMesh& mesh, const MfemNodes& nodes, const Team& team)
      : mesh(mesh),
        cells(mesh, mesh.dimension),
        number_(number_vertices(mesh)),
        topology(mesh.dimension, nodes.space.order, count_,
                 topology_cells(cells, [&](Shape shape, auto own) { return vertices_of(shape, own); }), team) {}

  /// Calls body(cell, shape, nodes) for the cells from begin to end − 1.
  template <class Body>
  void for_each(std::size_t begin, std::size_t end, const Body& body) const {
    for (std::size_t cell = begin; cell < end;) {
      const Cells::Range& range = cells.range_of(cell);
      for (const std::size_t stop = std::min(end, range.first + range.block->size()); cell < stop; ++cell)
        body(cell, range.block->shape,
             std::span(range.block->nodes.data() + (cell - range.first) * range.stride, range.stride));
    }
  }

  /// The number of a vertex from the index of its node; −1 if no cell has it as a vertex.
  std::int32_t vertex(std::int32_t node) const { return number_[std::size_t(node)]; }
  std::int32_t vertices() const { return count_; }
  /// Whether an element of the boundary is an edge or face of a cell.
  bool is_side(Shape shape, std::span<const std::int32_t> nodes) const {
    std::array<std::int32_t, 4> vertices{};
    const auto used = std::size_t(reference::info(shape).vertices);
    for (std::size_t v = 0; v < used; ++v)
      if ((vertices[v] = vertex(nodes[v])) < 0) return false;
    return (used == 2 ? topology.edge(vertices[0], vertices[1]) : topology.face({vertices.data(), used})) >= 0;
  }

  /// As find_unshared_side().
  std::optional<std::size_t> unshared_side(const Team& team) const {
    const auto numbers = [&](Shape shape, auto own) { return vertices_of(shape, own); };
    return find_unshared_side(mesh, cells, topology_cells(cells, numbers), topology, team);
  }

  const HighOrderMesh& mesh;
  const Cells cells;

 private:
  std::array<std::int32_t, 8> vertices_of(Shape shape, std::span<const std::int32_t> nodes) const {
    std::array<std::int32_t, 8> vertices{};
    for (std::size_t v = 0; v < std::size_t(reference::info(shape).vertices); ++v) vertices[v] = vertex(nodes[v]);
    return vertices;
  }
  std::vector<std::int32_t> number_vertices(const HighOrderMesh& mesh) {
    std::vector<std::int32_t> number(mesh.node_count(), -1);
    for (const ElementBlock& block : mesh.blocks) {
      if (!has_dimension(block, mesh.dimension)) continue;
      const auto count = std::size_t(reference::node_count(block.shape, block.order));
      for (std::size_t e = 0; e < block.size(); ++e)
        for (std::size_t v = 0; v < std::size_t(reference::info(block.shape).vertices); ++v)
          number[std::size_t(block.nodes[e * count + v])] = 0;
    }
    for (std::int32_t& each : number)
      if (each == 0) each = count_++;
    return number;
  }

  std::int32_t count_ = 0;
  std::vector<std::int32_t> number_;

 public:
  MfemTopology topology;
};

// === Sections ============================================================================================

/// How many things a thread writes at a time.
constexpr std::size_t kPerPiece = 8192;

std::int64_t written_elements(const Grid& grid, int dimension) {
  const Cells elements(grid.mesh, dimension);
  if (dimension == grid.mesh.dimension) return std::int64_t(elements.count());
  std::int64_t count = 0;
  for (std::size_t e = 0; e < elements.count(); ++e)
    count += grid.is_side(elements.shape(e), elements.nodes(e)) ? 1 : 0;
  return count;
}

/// Writes the cells, or the elements of the boundary that are sides of cells.
void write_elements(const Grid& grid, int dimension, const MfemAttributes& attributes, BufferedOutput& out) {
  out.text(dimension == grid.mesh.dimension ? "\nelements\n" : "\nboundary\n");
  out.text_integer(written_elements(grid, dimension));
  out.text("\n");
  for (std::size_t b = 0; b < grid.mesh.blocks.size(); ++b) {
    const ElementBlock& block = grid.mesh.blocks[b];
    if (!has_dimension(block, dimension)) continue;
    const auto count = std::size_t(reference::node_count(block.shape, block.order));
    out.shared(block.size(), kPerPiece, [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e) {
        const std::span nodes(block.nodes.data() + e * count, count);
        if (dimension < grid.mesh.dimension && !grid.is_side(block.shape, nodes)) continue;
        piece.text_integer(attributes.of_block[b]);
        piece.text(" ");
        piece.text_integer(mfem_geometry(block.shape));
        for (std::size_t v = 0; v < std::size_t(reference::info(block.shape).vertices); ++v) {
          piece.text(" ");
          piece.text_integer(grid.vertex(nodes[v]));
        }
        piece.text("\n");
      }
    });
  }
}

// === Nodes ===============================================================================================

/// The components to write of each point, on a line.
struct Components {
  int first, last;
};

void write_point(BufferedOutput& out, Components components, const Eigen::RowVector3d& point) {
  for (int c = components.first; c < components.last; ++c) {
    out.text_number(point(c));
    out.text(c + 1 < components.last ? " " : "\n");
  }
}

Eigen::RowVector3d at(const HighOrderMesh& mesh, std::int32_t node) {
  return Eigen::Map<const Eigen::RowVector3d>(mesh.coordinates.data() + 3 * std::size_t(node));
}

/// Writes the vertices in their order.
void write_vertices(const Grid& grid, Components components, BufferedOutput& out) {
  out.shared(grid.mesh.node_count(), kPerPiece, [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
    for (std::size_t node = begin; node < end; ++node)
      if (grid.vertex(std::int32_t(node)) >= 0) write_point(piece, components, at(grid.mesh, std::int32_t(node)));
  });
}

/// The degrees of freedom of one shape: a matrix, or which nodes they are.
struct ToFile {
  const Eigen::MatrixXd* matrix = nullptr;
  std::vector<Eigen::Index> nodes;  ///< Empty if they are no nodes.

  explicit ToFile(const Eigen::MatrixXd& of) : matrix(&of) {
    for (Eigen::Index row = 0; row < of.rows(); ++row) {
      Eigen::Index node = 0;
      if (of.row(row).maxCoeff(&node) != 1 || of.row(row).cwiseAbs().sum() != 1) {
        nodes.clear();
        return;
      }
      nodes.push_back(node);
    }
  }
};

/// Writes what a space has on the edges, faces and cells of a mesh.
class DofWriter {
 public:
  DofWriter(const Grid& grid, const MfemSpace& space, Components components) : grid_(grid), components_(components) {
    for (const Cells::Range& range : grid.cells.ranges()) {
      const Shape shape = range.block->shape;
      know(space, shape);
      if (!space.continuous) continue;
      know(space, Shape::Line);
      for (const reference::Facet& face : faces_of(Sides::Mfem, shape)) know(space, face.shape);
    }
  }

  /// Calls body(piece, cell, shape, nodes) for all cells; the threads share them.
  template <class Body>
  void for_each(BufferedOutput& out, const Body& body) const {
    out.shared(grid_.cells.count(), kPerPiece, [&](BufferedOutput& piece, std::size_t begin, std::size_t end) {
      grid_.for_each(begin, end, [&](std::size_t cell, Shape shape, std::span<const std::int32_t> nodes) {
        body(piece, cell, shape, nodes);
      });
    });
  }

  void edges(BufferedOutput& out) const {
    for_each(out, [&](BufferedOutput& piece, std::size_t cell, Shape shape, std::span<const std::int32_t> nodes) {
      const auto edges = edges_of(Sides::Mfem, shape);
      std::array<std::int32_t, kMaxOrder + 1> whole{};
      for (std::size_t e = 0; e < edges.size(); ++e) {
        if (!grid_.topology.is_first_edge(cell, e)) continue;
        const std::vector<int>& inner = local_[std::size_t(shape)]->edges[e];
        const std::int32_t a = nodes[std::size_t(edges[e][0])], b = nodes[std::size_t(edges[e][1])];
        const bool forward = grid_.vertex(a) < grid_.vertex(b);
        whole[0] = forward ? a : b;
        whole[1] = forward ? b : a;
        for (std::size_t i = 0; i < inner.size(); ++i)
          whole[2 + i] = nodes[std::size_t(inner[forward ? i : inner.size() - 1 - i])];
        write(piece, *to_file_[std::size_t(Shape::Line)], {whole.data(), inner.size() + 2});
      }
    });
  }

  void faces(BufferedOutput& out) const {
    for_each(out, [&](BufferedOutput& piece, std::size_t cell, Shape shape, std::span<const std::int32_t> nodes) {
      const auto faces = faces_of(Sides::Mfem, shape);
      std::array<std::int32_t, (kMaxOrder + 1) * (kMaxOrder + 1)> whole{};
      for (std::size_t f = 0; f < faces.size(); ++f) {
        if (!grid_.topology.is_first_face(cell, f)) continue;
        const std::vector<int>& local = local_[std::size_t(shape)]->whole_faces[f];
        for (std::size_t i = 0; i < local.size(); ++i) whole[i] = nodes[std::size_t(local[i])];
        write(piece, *to_file_[std::size_t(faces[f].shape)], {whole.data(), local.size()});
      }
    });
  }

  void cells(BufferedOutput& out) const {
    for_each(out, [&](BufferedOutput& piece, std::size_t, Shape shape, std::span<const std::int32_t> nodes) {
      write(piece, *to_file_[std::size_t(shape)], nodes);
    });
  }

 private:
  /// Looks up what all cells of a shape share.
  void know(const MfemSpace& space, Shape shape) {
    if (to_file_[std::size_t(shape)]) return;
    local_[std::size_t(shape)] = &mfem_local_nodes(shape, space.order);
    to_file_[std::size_t(shape)].emplace(mfem_conversion(space, shape).to_file);
  }
  void write(BufferedOutput& out, const ToFile& to_file, std::span<const std::int32_t> nodes) const {
    for (const Eigen::Index node : to_file.nodes)
      write_point(out, components_, at(grid_.mesh, nodes[std::size_t(node)]));
    if (!to_file.nodes.empty() || to_file.matrix->rows() == 0) return;
    Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor> x(Eigen::Index(nodes.size()), 3);
    for (std::size_t i = 0; i < nodes.size(); ++i) x.row(Eigen::Index(i)) = at(grid_.mesh, nodes[i]);
    x = (*to_file.matrix * x).eval();
    for (Eigen::Index i = 0; i < x.rows(); ++i) write_point(out, components_, x.row(i));
  }

  const Grid& grid_;
  const Components components_;
  std::array<const MfemLocalNodes*, kShapes> local_{};
  std::array<std::optional<ToFile>, kShapes> to_file_;
};

/// The degrees of freedom of a space: those of vertices, edges, faces and cells, or only those of cells.
void write_dofs(const Grid& grid, const MfemSpace& space, Components components, BufferedOutput& out) {
  const DofWriter dofs(grid, space, components);
  if (!space.continuous) return dofs.cells(out);
  write_vertices(grid, components, out);
  if (space.order == 1) return;
  dofs.edges(out);
  const bool has_inner = space.order > 2 || grid.topology.has_quadrilaterals();
  if (grid.mesh.dimension == 3 && has_inner) dofs.faces(out);
  dofs.cells(out);
}

void write_grid_function(const Grid& grid, const MfemNodes& nodes, BufferedOutput& out) {
  out.text("\nnodes\nFiniteElementSpace\nFiniteElementCollection: ");
  out.text(nodes.space.name);
  out.text("\nVDim: ");
  out.text_integer(nodes.components);
  out.text("\nOrdering: ");
  out.text_integer(nodes.by_nodes ? 0 : 1);
  out.text("\n\n");
  if (!nodes.by_nodes) return write_dofs(grid, nodes.space, {0, nodes.components}, out);
  for (int c = 0; c < nodes.components; ++c) write_dofs(grid, nodes.space, {c, c + 1}, out);
}

bool is_remembered(const HighOrderMesh& mesh) {
  return std::any_of(mesh.foreign.begin(), mesh.foreign.end(), [](const ForeignSection& section) {
    return section.format == "mfem" && section.name == kRemembered;
  });
}

int components_of(const HighOrderMesh& mesh) {
  if (mesh.dimension == 3) return 3;
  for (std::size_t i = 2; i < mesh.coordinates.size(); i += 3)
    if (mesh.coordinates[i] != 0) return 3;
  return 2;
}

}  // namespace

int mfem_geometry(Shape shape) {
  constexpr std::array kGeometries = {0, 1, 2, 3, 4, 7, 6, 5};
  return kGeometries[std::size_t(shape)];
}

void remember_mfem_nodes(HighOrderMesh& mesh, const MfemNodes& nodes) {
  mesh.foreign.push_back({std::string(kRemembered),
                          nodes.space.name + " " + std::to_string(nodes.components) + (nodes.by_nodes ? " 0" : " 1"),
                          "mfem"});
}

MfemNodes mfem_nodes_of(const HighOrderMesh& mesh) {
  MfemNodes nodes{default_mfem_space(mesh.dimension, mesh.order), components_of(mesh), false};
  for (const ForeignSection& section : mesh.foreign) {
    if (section.format != "mfem" || section.name != kRemembered) continue;
    const std::size_t space = section.bytes.find(' ');
    const auto known = mfem_space(std::string_view(section.bytes).substr(0, space));
    if (!known || known->order != mesh.order || section.bytes.size() != space + 4) continue;
    const bool fits = std::none_of(mesh.blocks.begin(), mesh.blocks.end(), [&](const ElementBlock& block) {
      return has_dimension(block, mesh.dimension) && !why_not_in_space(*known, block.shape).empty();
    });
    if (fits) nodes = {*known, std::max(nodes.components, section.bytes[space + 1] - '0'), section.bytes.back() == '0'};
  }
  return nodes;
}

std::string not_in_mfem(const HighOrderMesh& mesh) {
  LeftOut lost;
  lost.small_elements(mesh);
  const auto sides = mesh.dimension > 1 ? std::int64_t(mesh.element_count(mesh.dimension - 1)) : 0;
  if (sides > 0) {
    const Grid grid(mesh, mfem_nodes_of(mesh), Team(1));
    lost.stray_sides(sides - written_elements(grid, mesh.dimension - 1));
  }
  lost.add_if(!mesh.periodic.empty(), "periodic links");
  lost.entities_and_partitions(mesh);
  // A file has no numbers. A reader counts nodes and elements, and VariMesh counts those of a curved mesh as MFEM does.
  lost.numbers_if((mesh.order > 1 && !is_remembered(mesh)) || !are_nodes_counted(mesh) ||
                  !are_elements_counted(mesh, {mesh.dimension, mesh.dimension - 1}));
  return lost.sentence("MFEM's format");
}

Expected<void> check_mfem_sides(const HighOrderMesh& mesh, const Team& team) {
  const MfemNodes nodes = mfem_nodes_of(mesh);
  if (!nodes.space.continuous || mesh.dimension < 2 || mesh.order == 1) return {};
  const Grid grid(mesh, nodes, team);
  if (const auto cell = grid.unshared_side(team)) return unshared_side(grid.cells, *cell, "MFEM's");
  return {};
}

Expected<void> write_mfem(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField>,
                          const Team& team) {
  if (mesh.dimension < 2) return bad_option("VariMesh writes MFEM's meshes of dimension 2 and 3 only; write vtu.");
  const MfemNodes nodes = mfem_nodes_of(mesh);
  const Grid grid(mesh, nodes, team);
  if (const auto cell = nodes.space.continuous && mesh.order > 1 ? grid.unshared_side(team) : std::nullopt)
    return unshared_side(grid.cells, *cell, "MFEM's");
  const MfemAttributes cells = mfem_attributes(mesh, mesh.dimension);
  const MfemAttributes faces = mfem_attributes(mesh, mesh.dimension - 1);
  const bool named = !cells.sets.empty() || !faces.sets.empty();
  BufferedOutput out(sink, false, team);
  out.text(named ? "MFEM mesh v1.3\n" : "MFEM mesh v1.0\n");
  out.text("\ndimension\n");
  out.text_integer(mesh.dimension);
  out.text("\n");
  write_elements(grid, mesh.dimension, cells, out);
  if (named) write_mfem_sets("attribute_sets", cells, out);
  write_elements(grid, mesh.dimension - 1, faces, out);
  if (named) write_mfem_sets("bdr_attribute_sets", faces, out);
  out.text("\nvertices\n");
  out.text_integer(grid.vertices());
  out.text("\n");
  if (mesh.order == 1 && !is_remembered(mesh)) {
    out.text_integer(nodes.components);
    out.text("\n");
    write_vertices(grid, {0, nodes.components}, out);
  } else {
    write_grid_function(grid, nodes, out);
  }
  if (named) out.text("\nmfem_mesh_end\n");
  return out.finish();
}

}  // namespace varimesh::formats
