// Writes MFEM's meshes.
#include <algorithm>
#include <cassert>
#include <charconv>
#include <cstdlib>
#include <map>

#include "core/formats/buffered_output.h"
#include "core/formats/mfem/attributes.h"
#include "core/formats/mfem/mfem.h"
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
  Grid(const HighOrderMesh& mesh, const MfemNodes& nodes)
      : mesh(mesh), number_(number_vertices(mesh)), topology(mesh.dimension, nodes.space.order, count_) {
    for_each([&](const ElementBlock& block, std::span<const std::int32_t>, std::span<const std::int32_t> vertices) {
      topology.add(block.shape, vertices);
    });
    topology.finish();
  }

  /// Calls body(block, nodes, vertices) for each cell in the mesh's order.
  template <class Body>
  void for_each(const Body& body) const {
    for (const ElementBlock& block : mesh.blocks) {
      if (!has_dimension(block, mesh.dimension)) continue;
      const auto count = std::size_t(reference::node_count(block.shape, block.order));
      for (std::size_t e = 0; e < block.size(); ++e) {
        const std::span nodes(block.nodes.data() + e * count, count);
        std::array<std::int32_t, 8> vertices{};
        const auto used = std::size_t(reference::info(block.shape).vertices);
        for (std::size_t v = 0; v < used; ++v) vertices[v] = vertex(nodes[v]);
        body(block, nodes, std::span<const std::int32_t>(vertices.data(), used));
      }
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

  const HighOrderMesh& mesh;

 private:
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

/// Calls body(block number, block, nodes) for each element of this dimension that the file has: cells, and the elements
/// of the boundary that are sides of cells.
template <class Body>
void for_each_written(const Grid& grid, int dimension, const Body& body) {
  for (std::size_t b = 0; b < grid.mesh.blocks.size(); ++b) {
    const ElementBlock& block = grid.mesh.blocks[b];
    if (!has_dimension(block, dimension)) continue;
    const auto count = std::size_t(reference::node_count(block.shape, block.order));
    for (std::size_t e = 0; e < block.size(); ++e) {
      const std::span nodes(block.nodes.data() + e * count, count);
      if (dimension == grid.mesh.dimension || grid.is_side(block.shape, nodes)) body(b, block, nodes);
    }
  }
}

std::int64_t written_elements(const Grid& grid, int dimension) {
  std::int64_t count = 0;
  for_each_written(grid, dimension, [&](std::size_t, const ElementBlock&, std::span<const std::int32_t>) { ++count; });
  return count;
}

void write_elements(const Grid& grid, int dimension, const MfemAttributes& attributes, BufferedOutput& out) {
  out.text(dimension == grid.mesh.dimension ? "\nelements\n" : "\nboundary\n");
  out.text_integer(written_elements(grid, dimension));
  out.text("\n");
  for_each_written(grid, dimension, [&](std::size_t b, const ElementBlock& block, std::span<const std::int32_t> nodes) {
    out.text_integer(attributes.of_block[b]);
    out.text(" ");
    out.text_integer(mfem_geometry(block.shape));
    for (std::size_t v = 0; v < std::size_t(reference::info(block.shape).vertices); ++v) {
      out.text(" ");
      out.text_integer(grid.vertex(nodes[v]));
    }
    out.text("\n");
  });
}

void write_sets(std::string_view section, const MfemAttributes& attributes, BufferedOutput& out) {
  out.text("\n");
  out.text(section);
  out.text("\n");
  out.text_integer(std::int64_t(attributes.sets.size()));
  out.text("\n");
  for (const auto& [name, members] : attributes.sets) {
    out.text("\"");
    out.text(name);
    out.text("\" ");
    out.text_integer(std::int64_t(members.size()));
    for (const int attribute : members) {
      out.text(" ");
      out.text_integer(attribute);
    }
    out.text("\n");
  }
}

/// Writes points as rows of `components` numbers, or one component of each.
class PointWriter {
 public:
  /// @param first,last the components to write; a line per point
  PointWriter(BufferedOutput& out, int first, int last) : out_(out), first_(first), last_(last) {}

  void operator()(const Eigen::RowVector3d& point) const {
    for (int c = first_; c < last_; ++c) {
      out_.text_number(point(c));
      out_.text(c + 1 < last_ ? " " : "\n");
    }
  }

 private:
  BufferedOutput& out_;
  int first_, last_;
};

using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

Eigen::RowVector3d at(const HighOrderMesh& mesh, std::int32_t node) {
  return Eigen::Map<const Eigen::RowVector3d>(mesh.coordinates.data() + 3 * std::size_t(node));
}

Columns points(const HighOrderMesh& mesh, std::span<const std::int32_t> nodes) {
  Columns found(Eigen::Index(nodes.size()), 3);
  for (std::size_t i = 0; i < nodes.size(); ++i) found.row(Eigen::Index(i)) = at(mesh, nodes[i]);
  return found;
}

void write_rows(const Eigen::MatrixXd& matrix, const Columns& x, const PointWriter& write) {
  const Columns rows = matrix * x;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) write(rows.row(i));
}

/// The degrees of freedom of a continuous space: those of vertices, edges, faces and cells.
void write_continuous(const Grid& grid, const MfemSpace& space, const PointWriter& write) {
  const HighOrderMesh& mesh = grid.mesh;
  for (std::size_t node = 0; node < mesh.node_count(); ++node)
    if (grid.vertex(std::int32_t(node)) >= 0) write(at(mesh, std::int32_t(node)));
  if (space.order == 1) return;
  std::int32_t next = 0;
  std::vector<std::int32_t> whole;
  grid.for_each([&](const ElementBlock& block, auto nodes, auto vertices) {
    const auto edges = mfem_edges(block.shape);
    for (std::size_t e = 0; e < edges.size(); ++e) {
      auto [a, b] = edges[e];
      if (grid.topology.edge(vertices[std::size_t(a)], vertices[std::size_t(b)]) != next) continue;
      ++next;
      std::vector<int> inner = mfem_local_nodes(block.shape, space.order).edges[e];
      if (vertices[std::size_t(a)] > vertices[std::size_t(b)]) {
        std::swap(a, b);
        std::reverse(inner.begin(), inner.end());
      }
      whole = {nodes[std::size_t(a)], nodes[std::size_t(b)]};
      for (const int local : inner) whole.push_back(nodes[std::size_t(local)]);
      write_rows(mfem_conversion(space, Shape::Line).to_file, points(mesh, whole), write);
    }
  });
  next = 0;
  const bool has_inner = space.order > 2 || grid.topology.has_quadrilaterals();
  if (mesh.dimension == 3 && has_inner)
    grid.for_each([&](const ElementBlock& block, auto nodes, auto vertices) {
      const auto faces = mfem_faces(block.shape);
      for (std::size_t f = 0; f < faces.size(); ++f) {
        const auto count = std::size_t(reference::info(faces[f].shape).vertices);
        std::array<std::int32_t, 4> own{};
        for (std::size_t v = 0; v < count; ++v) own[v] = vertices[std::size_t(faces[f].vertices[v])];
        if (grid.topology.face({own.data(), count}) != next) continue;
        ++next;
        whole.clear();
        for (const int local : mfem_local_nodes(block.shape, space.order).whole_faces[f])
          whole.push_back(nodes[std::size_t(local)]);
        write_rows(mfem_conversion(space, faces[f].shape).to_file, points(mesh, whole), write);
      }
    });
  grid.for_each([&](const ElementBlock& block, auto nodes, auto) {
    write_rows(mfem_conversion(space, block.shape).to_file, points(mesh, nodes), write);
  });
}

void write_grid_function(const Grid& grid, const MfemNodes& nodes, BufferedOutput& out) {
  out.text("\nnodes\nFiniteElementSpace\nFiniteElementCollection: ");
  out.text(nodes.space.name);
  out.text("\nVDim: ");
  out.text_integer(nodes.components);
  out.text("\nOrdering: ");
  out.text_integer(nodes.by_nodes ? 0 : 1);
  out.text("\n\n");
  for (int c = 0; c < (nodes.by_nodes ? nodes.components : 1); ++c) {
    const PointWriter write(out, c, nodes.by_nodes ? c + 1 : nodes.components);
    if (nodes.space.continuous) {
      write_continuous(grid, nodes.space, write);
    } else {
      grid.for_each([&](const ElementBlock& block, auto own, auto) {
        write_rows(mfem_conversion(nodes.space, block.shape).to_file, points(grid.mesh, own), write);
      });
    }
  }
}

void write_vertices(const Grid& grid, int components, BufferedOutput& out) {
  out.text_integer(components);
  out.text("\n");
  const PointWriter write(out, 0, components);
  for (std::size_t node = 0; node < grid.mesh.node_count(); ++node)
    if (grid.vertex(std::int32_t(node)) >= 0) write(at(grid.mesh, std::int32_t(node)));
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
  std::vector<std::string> lost;
  for (int d = mesh.dimension - 2; d >= 0; --d)
    if (const std::size_t n = mesh.element_count(d); n > 0)
      lost.push_back(std::to_string(n) + (d == 0 ? " point" : " line") + (n == 1 ? "" : "s"));
  const auto sides = mesh.dimension > 1 ? std::int64_t(mesh.element_count(mesh.dimension - 1)) : 0;
  if (sides > 0) {
    const Grid grid(mesh, mfem_nodes_of(mesh));
    if (const std::int64_t n = sides - written_elements(grid, mesh.dimension - 1); n > 0)
      lost.push_back(std::to_string(n) + (n == 1 ? " boundary element that is" : " boundary elements that are") +
                     " no side of an element");
  }
  if (!mesh.periodic.empty()) lost.push_back("periodic links");
  if (std::any_of(mesh.blocks.begin(), mesh.blocks.end(), [](const auto& block) { return !block.partitions.empty(); }))
    lost.push_back("partitions");
  if (!mesh.entities.empty()) lost.push_back("entities of the geometry");
  // A file has no numbers. A reader counts nodes and elements, and VariMesh counts those of a curved mesh as MFEM does.
  std::int64_t next = 0;
  bool renumbers = mesh.order > 1 && !is_remembered(mesh);
  for (const std::int64_t number : mesh.node_numbers) renumbers = renumbers || number != ++next;
  next = 0;
  for (const int d : {mesh.dimension, mesh.dimension - 1})
    for (const ElementBlock& block : mesh.blocks)
      if (has_dimension(block, d))
        for (const std::int64_t number : block.numbers) renumbers = renumbers || number != ++next;
  if (renumbers) lost.push_back("the numbers of nodes and elements");
  std::string text;
  for (std::size_t i = 0; i < lost.size(); ++i) text += (i == 0 ? "" : i + 1 == lost.size() ? " and " : ", ") + lost[i];
  return text.empty() ? text : "MFEM's format has no place for " + text + "; the file leaves them out.";
}

Expected<void> write_mfem(const HighOrderMesh& mesh, Format, const Sink& sink, std::span<const CellField>,
                          const Team& team) {
  if (mesh.dimension < 2) return bad_option("VariMesh writes MFEM's meshes of dimension 2 and 3 only; write vtu.");
  const MfemNodes nodes = mfem_nodes_of(mesh);
  const Grid grid(mesh, nodes);
  const MfemAttributes cells = mfem_attributes(mesh, mesh.dimension);
  const MfemAttributes faces = mfem_attributes(mesh, mesh.dimension - 1);
  const bool named = !cells.sets.empty() || !faces.sets.empty();
  BufferedOutput out(sink, false, team);
  out.text(named ? "MFEM mesh v1.3\n" : "MFEM mesh v1.0\n");
  out.text("\ndimension\n");
  out.text_integer(mesh.dimension);
  out.text("\n");
  write_elements(grid, mesh.dimension, cells, out);
  if (named) write_sets("attribute_sets", cells, out);
  write_elements(grid, mesh.dimension - 1, faces, out);
  if (named) write_sets("bdr_attribute_sets", faces, out);
  out.text("\nvertices\n");
  out.text_integer(grid.vertices());
  out.text("\n");
  if (mesh.order == 1 && !is_remembered(mesh))
    write_vertices(grid, nodes.components, out);
  else
    write_grid_function(grid, nodes, out);
  if (named) out.text("\nmfem_mesh_end\n");
  return out.finish();
}

}  // namespace varimesh::formats
