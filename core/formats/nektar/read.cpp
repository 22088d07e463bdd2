// Makes a mesh of the lists of a Nektar++ file.
#include <algorithm>
#include <cassert>
#include <memory>
#include <optional>

#include "core/base/io/scanner.h"
#include "core/formats/common/format.h"
#include "core/formats/mfem/space.h"
#include "core/formats/mfem/topology.h"
#include "core/formats/nektar/composites.h"
#include "core/formats/nektar/file.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/nektar/place.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

class Reading {
 public:
  Reading(NektarFile file, FileAllowance& allowance, const Team& team)
      : file_(std::move(file)), allowance_(allowance), team_(team) {}

  /// Nothing if the points must be in memory, and are not.
  std::optional<HighOrderMesh> take(bool has_points) {
    mesh_.dimension = file_.dimension;
    mesh_.order = order();
    return_freed_memory();
    corners_ = nektar_corners(file_, allowance_);
    topology_.emplace(make_topology());
    count_nodes();
    std::optional<NektarPointNodes> points;
    if (!has_points) {
      points =
          nektar_point_nodes(file_, corners_, *topology_, mesh_.order, std::size_t(nodes_), cell_finder(), allowance_);
      if (!points) return std::nullopt;
      free_memory(file_.curved_edges);
      free_memory(file_.curved_faces);
      free_memory(file_.index);
    }
    {
      const NektarGroups groups = nektar_groups(file_, allowance_);
      std::vector<ElementBlock> sides = make_sides(groups);
      if (!has_points) {
        free_memory(file_.edges);
        if (has_all_faces(points->placed)) free_memory(corners_.faces);
        return_freed_memory();
      }
      make_cells(groups);
      std::move(sides.begin(), sides.end(), std::back_inserter(mesh_.blocks));
      mesh_.physical_groups = groups.named;
    }
    if (!has_points) {
      free_memory(corners_.cells);
      if (corners_.faces.empty()) topology_.reset();
      return_freed_memory();
    }
    allocate();
    std::copy(file_.vertices.begin(), file_.vertices.end(), mesh_.coordinates.begin());
    free_memory(file_.vertices);
    if (!(has_points ? place_kept_points() : place_points(*points))) return std::nullopt;
    mesh_.foreign = std::move(file_.others);
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { Scanner(file_.bytes).fail(what); }

  int order() const {
    int order = 1;
    for (const NektarCurve& curve : file_.curved_edges) order = std::max(order, checked_degree(Shape::Line, curve));
    const NektarParts& faces = mesh_.dimension == 3 ? file_.faces : file_.elements;
    for (const NektarCurve& curve : file_.curved_faces) {
      const std::int32_t face = faces.ids.find(curve.id);
      if (face < 0) fail("the curve of face " + std::to_string(curve.id) + " is of a face that is not in the file");
      order = std::max(order, checked_degree(faces.shapes[std::size_t(face)], curve));
    }
    return order;
  }

  int checked_degree(Shape shape, const NektarCurve& curve) const {
    const std::string name = (shape == Shape::Line ? "edge " : "face ") + std::to_string(curve.id);
    const int degree = nektar_degree(shape, curve.count);
    if (degree == 0)
      fail("the curve of " + name + " has " + std::to_string(curve.count) + " points, which no " +
           std::string(reference::info(shape).name) + " of order 1 to " + std::to_string(kMaxOrder) + " has");
    const bool other = curve.points == NektarPoints::OtherTriangle;
    if (other && shape != Shape::Triangle) fail("the curve of " + name + " has points that are for triangles");
    if (other && degree > 3)
      fail("the curve of " + name +
           " has electrostatic or Fekete points of order 4 or above; VariMesh reads evenly spaced ones, so give it the "
           "mesh from which NekMesh made this file");
    if (!other && shape == Shape::Triangle && curve.points == NektarPoints::GaussLobatto)
      fail("the curve of " + name + " has points of a square on a triangle; VariMesh reads NodalTriEvenlySpaced");
    return degree;
  }

  // === Nodes =============================================================================================

  MfemTopology make_topology() {
    if (file_.vertex_ids.size() > std::size_t(kMostNodes)) fail("it has too many vertices");
    Scanner counted(file_.bytes);
    counted.allowance = allowance_.counted();
    // Where the vertices of every kStep-th cell begin, because shapes have different numbers of vertices.
    constexpr std::size_t kStep = 1024;
    std::vector<std::size_t> first;
    std::size_t vertices = 0;
    for (std::size_t e = 0; e < file_.elements.shapes.size(); ++e) {
      if (e % kStep == 0) first.push_back(vertices);
      vertices += std::size_t(reference::info(file_.elements.shapes[e]).vertices);
    }
    const auto visit = [&](std::size_t begin, std::size_t end, const TopologyCells::Body& body) {
      const std::int32_t* own = corners_.cells.data() + first[begin / kStep];
      for (std::size_t e = begin / kStep * kStep; e < end; ++e) {
        const Shape shape = file_.elements.shapes[e];
        const auto count = std::size_t(reference::info(shape).vertices);
        if (e >= begin) body(e, shape, {own, count});
        own += count;
      }
    };
    return MfemTopology(mesh_.dimension, mesh_.order, std::int32_t(file_.vertex_ids.size()),
                        {file_.elements.shapes.size(), visit}, team_, &counted);
  }

  void count_nodes() {
    nodes_ = topology_->interior_first();
    std::int64_t of_elements = 0;
    for (const Shape shape : file_.elements.shapes) {
      nodes_ += inner_node_count(shape, mesh_.order);
      of_elements += reference::node_count(shape, mesh_.order);
    }
    if (nodes_ > kMostNodes) fail("it has " + std::to_string(nodes_) + " nodes, more than VariMesh takes");
    allowance_.take(std::size_t(nodes_), 3 * sizeof(double) + sizeof(std::int64_t));
    allowance_.take(std::size_t(of_elements), sizeof(std::int32_t));
  }

  void allocate() {
    mesh_.coordinates.resize(3 * std::size_t(nodes_));
    mesh_.node_numbers.resize(std::size_t(nodes_));
    for (std::size_t i = 0; i < mesh_.node_numbers.size(); ++i) mesh_.node_numbers[i] = std::int64_t(i) + 1;
    mesh_.node_blocks = {{-1, 0, 0, std::int32_t(nodes_)}};
  }

  /// Finds the cells of a 2-D mesh.
  std::function<NektarCell(std::int32_t)> cell_finder() const {
    struct Start {
      std::size_t vertices;
      std::int32_t interior;
    };
    if (mesh_.dimension == 3) return {};
    auto starts = std::make_shared<std::vector<Start>>();
    allowance_.take(file_.elements.shapes.size(), sizeof(Start));
    Start next{0, std::int32_t(topology_->interior_first())};
    for (const Shape shape : file_.elements.shapes) {
      starts->push_back(next);
      next.vertices += std::size_t(reference::info(shape).vertices);
      next.interior += inner_node_count(shape, mesh_.order);
    }
    return [this, starts](std::int32_t element) {
      const auto count = std::size_t(reference::info(file_.elements.shapes[std::size_t(element)]).vertices);
      const Start& start = (*starts)[std::size_t(element)];
      return NektarCell{{corners_.cells.data() + start.vertices, count}, start.interior};
    };
  }

  /// Whether all nodes inside faces of a 3-D mesh are placed by points.
  bool has_all_faces(const std::vector<bool>& placed) const {
    const auto begin = placed.begin() + std::ptrdiff_t(topology_->face_first(0));
    return std::find(begin, placed.begin() + std::ptrdiff_t(topology_->interior_first()), false) ==
           placed.begin() + std::ptrdiff_t(topology_->interior_first());
  }
  bool place_points(const NektarPointNodes& points) {
    for_each_block([&](const ElementBlock& block, std::size_t count, std::size_t) {
      for (std::size_t e = 0; e < block.size(); ++e)
        place_straight_edges(block.shape, {block.nodes.data() + e * count, count}, points.placed, mesh_);
    });
    if (!place_nektar_points(file_, points, mesh_, allowance_, team_)) return false;
    place_rest(points.placed);
    return true;
  }

  bool place_kept_points() {
    NektarPlacing placing(file_, mesh_);
    std::vector<bool> placed(std::size_t(nodes_), false);
    placing.place_edges(*topology_);
    if (mesh_.dimension == 3) {
      placing.place_faces(corners_, *topology_, placed);
    } else {
      const auto cell_of = cell_finder();
      std::vector<std::int32_t> nodes;
      for (const NektarCurve& curve : file_.curved_faces) {
        const std::int32_t element = file_.elements.ids.find(curve.id);
        const Shape shape = file_.elements.shapes[std::size_t(element)];
        const NektarCell cell = cell_of(element);
        nodes.resize(std::size_t(reference::node_count(shape, mesh_.order)));
        (void)topology_->find_nodes(shape, cell.vertices, cell.interior, nodes);
        placing.place_curve(shape, curve, nodes);
        for (int i = 0; i < inner_node_count(shape, mesh_.order); ++i) placed[std::size_t(cell.interior + i)] = true;
      }
    }
    place_rest(placed);
    return true;
  }

  /// Places the nodes that follow from others: those inside faces and cells that no curve has placed.
  void place_rest(const std::vector<bool>& placed) {
    NektarBlender blender(mesh_);
    std::vector<std::int32_t> nodes;
    for (std::size_t f = 0; f < corners_.faces.size() / corners_.per_face; ++f) {
      const Shape shape = file_.faces.shapes[f];
      const auto inner = std::size_t(inner_node_count(shape, mesh_.order));
      if (inner == 0) continue;
      nodes.resize(std::size_t(reference::node_count(shape, mesh_.order)));
      if (!topology_->find_nodes(shape, corners_.face(f, shape), 0, nodes)) continue;  // no cell has it
      if (!placed[std::size_t(nodes.back())]) blender.blend(nektar_blending(shape, mesh_.order), nodes);
    }
    for_each_block([&](const ElementBlock& block, std::size_t count, std::size_t first) {
      if (inner_node_count(block.shape, mesh_.order) == 0) return;
      const NektarBlending& blending = nektar_blending(block.shape, mesh_.order);
      constexpr std::size_t kCellsPerTask = 1024;
      FirstFault fault;
      team_.for_ranges(block.size(), kCellsPerTask, [&](std::size_t begin, std::size_t end) {
        fault.guard(begin, [&] {
          NektarBlender own(mesh_);
          for (std::size_t e = begin; e < end; ++e) {
            const std::span cell(block.nodes.data() + e * count, count);
            if (placed[std::size_t(cell.back())]) continue;
            own.blend(blending, cell);
            if (own.leaves_space(blending)) fail_outside(first + e);
          }
        });
      });
      fault.throw_it();
    });
  }

  [[noreturn]] void fail_outside(std::size_t element) const {
    fail("pyramid " + std::to_string(file_.elements.ids[element]) +
         " has a base that is curved in a way that Nektar++ continues inside the pyramid with a higher order than " +
         std::to_string(mesh_.order) + ", which VariMesh cannot certify; give VariMesh the mesh before NekMesh");
  }

  // === Elements ==========================================================================================

  /// Calls body(block, nodes per cell, its first element in the file) for the blocks of cells.
  template <class Body>
  void for_each_block(const Body& body) const {
    std::size_t first = 0;
    for (const ElementBlock& block : mesh_.blocks) {
      if (reference::info(block.shape).dimension != mesh_.dimension) continue;
      body(block, std::size_t(reference::node_count(block.shape, mesh_.order)), first);
      first += block.size();
    }
  }

  /// The boundary elements of each composite.
  std::vector<ElementBlock> make_sides(const NektarGroups& groups) {
    std::vector<ElementBlock> sides;
    auto number = std::int64_t(file_.elements.shapes.size());
    for (const auto& [item, tags] : groups.of_sides) {
      if (mesh_.dimension == 2) {
        const std::array own = {file_.edges[2 * std::size_t(item)], file_.edges[2 * std::size_t(item) + 1]};
        add_side(sides, Shape::Line, own, tags, ++number);
      } else {
        const Shape shape = file_.faces.shapes[std::size_t(item)];
        add_side(sides, shape, corners_.face(std::size_t(item), shape), tags, ++number);
      }
    }
    return sides;
  }

  /// Cells in the file's order.
  void make_cells(const NektarGroups& groups) {
    const std::vector<Shape>& shapes = file_.elements.shapes;
    std::int64_t interior = topology_->interior_first(), number = 0;
    std::size_t vertices = 0;
    for (std::size_t begin = 0, end = 0; begin < shapes.size(); begin = end) {
      const Shape shape = shapes[begin];
      while (end < shapes.size() && shapes[end] == shape && groups.of_elements[end] == groups.of_elements[begin]) ++end;
      ElementBlock& block = add_block(mesh_.blocks, shape, groups.lists[std::size_t(groups.of_elements[begin])]);
      const std::size_t count = end - begin, per_cell = std::size_t(reference::info(shape).vertices);
      allowance_.take(count, 16);
      block.numbers.resize(count);
      for (std::int64_t& each : block.numbers) each = ++number;
      fill(block, count, corners_.cells.data() + vertices, interior);
      vertices += count * per_cell;
      interior += std::int64_t(count) * inner_node_count(shape, mesh_.order);
    }
  }

  ElementBlock& add_block(std::vector<ElementBlock>& blocks, Shape shape, const std::vector<int>& tags) {
    ElementBlock fresh;
    fresh.shape = shape;
    fresh.order = mesh_.order;
    fresh.entity = tags.empty() ? 1 : tags.front();
    fresh.physical = tags;
    allowance_.take(1, sizeof(ElementBlock));
    blocks.push_back(std::move(fresh));
    return blocks.back();
  }

  /// The nodes of cells from their vertices.
  void fill(ElementBlock& block, std::size_t cells, const std::int32_t* vertices, std::int64_t interior) {
    const auto count = std::size_t(reference::node_count(block.shape, mesh_.order));
    const auto corners = std::size_t(reference::info(block.shape).vertices);
    const int inner = inner_node_count(block.shape, mesh_.order);
    block.nodes.resize(cells * count);
    constexpr std::size_t kCellsPerTask = 2048;
    team_.for_ranges(cells, kCellsPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t e = begin; e < end; ++e)
        (void)topology_->find_nodes(block.shape, {vertices + e * corners, corners},
                                    std::int32_t(interior + std::int64_t(e) * inner),
                                    {block.nodes.data() + e * count, count});
    });
  }

  void add_side(std::vector<ElementBlock>& sides, Shape shape, std::span<const std::int32_t> vertices,
                const std::vector<int>& tags, std::int64_t number) {
    const bool same = !sides.empty() && sides.back().shape == shape && sides.back().physical == tags;
    ElementBlock& block = same ? sides.back() : add_block(sides, shape, tags);
    allowance_.take(1, 16);
    block.numbers.push_back(number);
    const std::size_t first = block.nodes.size(), count = std::size_t(reference::node_count(shape, mesh_.order));
    block.nodes.resize(first + count);
    if (!topology_->find_nodes(shape, vertices, 0, {block.nodes.data() + first, count}))
      fail("a composite has a side that belongs to no element");
  }

  NektarFile file_;
  FileAllowance& allowance_;
  const Team& team_;
  HighOrderMesh mesh_;
  NektarCorners corners_;
  std::optional<MfemTopology> topology_;
  std::int64_t nodes_ = 0;
};

}  // namespace

bool begins_like_nektar(std::string_view bytes) { return begins_with_element(bytes, "NEKTAR"); }

Expected<MeshFile> read_nektar(std::string_view bytes, const Team& team) {
  for (const bool keeps_points : {false, true}) {
    FileAllowance allowance(bytes.size(), team.stop());
    NektarFile file = parse_nektar(bytes, keeps_points, allowance, team);
    if (!file.compressed) file.others.push_back({std::string(kNektarText), "", "nektar"});
    if (file.elements.ids.size() == 0) Scanner(bytes).fail("it has no elements");
    if (auto mesh = Reading(std::move(file), allowance, team).take(keeps_points))
      return MeshFile{std::move(*mesh), Format::Nektar};
  }
  assert(!"points in memory always suffice");
  return MeshFile{};
}

}  // namespace varimesh::formats
