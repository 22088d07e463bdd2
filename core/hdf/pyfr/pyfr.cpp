#include "core/hdf/pyfr/pyfr.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <set>

#include "core/formats/hdf5/hdf5.h"
#include "core/formats/numbering/neighbours.h"
#include "core/formats/numbering/node_order.h"
#include "core/formats/numbering/sides.h"
#include "core/hdf/library/writer.h"
#include "core/hdf/pyfr/fingerprint.h"
#include "core/hdf/pyfr/numbers.h"
#include "core/mesh/connectivity.h"
#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

using Dims = std::vector<std::int64_t>;

/// A shape of PyFR.
struct PyfrShape {
  Shape shape;
  const char* name;
};

/// The shapes in the alphabetical order of the names, which PyFR's partitionings need.
constexpr std::array<PyfrShape, 6> kPyfrShapes = {{{Shape::Hexahedron, "hex"},
                                                   {Shape::Prism, "pri"},
                                                   {Shape::Pyramid, "pyr"},
                                                   {Shape::Quadrilateral, "quad"},
                                                   {Shape::Tetrahedron, "tet"},
                                                   {Shape::Triangle, "tri"}}};

/// The number in CGNS's order of each of PyFR's faces, counted from 0.
std::vector<int> cgns_numbers(Shape shape) {
  const auto faces = faces_of(Sides::Pyfr, shape);
  const auto same = same_sides(faces, faces_of(Sides::Cgns, shape));
  return {same.begin(), same.begin() + std::ptrdiff_t(faces.size())};
}

/// The name of a group, in which PyFR takes no slash. Names that become alike get the tag of their group.
std::string free_name(const SideGroup& group, std::set<std::string>& used) {
  std::string name = group.name;
  std::replace(name.begin(), name.end(), '/', '_');
  while (!used.insert(name).second) name += "_" + std::to_string(group.tag);
  return name;
}

/// Puts a value where `to` is, which moves behind it.
template <class T>
void put(char*& to, T value) {
  std::memcpy(to, &value, sizeof(T));
  to += sizeof(T);
}

class Writing {
 public:
  Writing(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team)
      : mesh_(mesh),
        team_(team),
        cells_(mesh, mesh.dimension),
        neighbours_(mesh, cells_, team),
        numbers_(mesh, cells_),
        writer_(writer) {}

  Expected<void> write() {
    if (auto two = check_two_at_sides(neighbours_.crowded(), kPyfrName); !two) return two;
    find_skew_base();
    if (skew_base_ != 0)
      return bad_option(
          "Element " + std::to_string(skew_base_) +
          " is a pyramid whose base is no parallelogram, which PyFR does not take; write msh41 for another "
          "solver.");
    make_codec();
    nodes();
    writer_.group("/eles");
    for (const PyfrShape& shape : kPyfrShapes)
      if (numbers_.own(shape.shape).count > 0) elements(shape);
    periodic();
    partitioning();
    names();
    return {};
  }

 private:
  // === Numbers =============================================================================================

  void find_skew_base() {
    for (const Cells::Range& range : cells_.ranges())
      for (std::size_t cell = range.first; cell < range.first + range.block->size(); ++cell) {
        if (range.block->shape != Shape::Pyramid) break;
        if (skew_base_ == 0 && !has_parallelogram(cell)) skew_base_ = cells_.number(cell);
      }
  }

  double coordinate(std::int32_t node, int k) const {
    return mesh_.coordinates[3 * std::size_t(node) + std::size_t(k)];
  }

  /// PyFR looks at this to within 1e-10.
  bool has_parallelogram(std::size_t cell) const {
    const auto n = cells_.nodes(cell);
    for (int k = 0; k < 3; ++k)
      if (std::abs(coordinate(n[0], k) - coordinate(n[1], k) + coordinate(n[2], k) - coordinate(n[3], k)) > 1e-10)
        return false;
    return true;
  }

  void make_codec() {
    for (const PyfrShape& shape : kPyfrShapes) {
      if (numbers_.own(shape.shape).count == 0) continue;
      const std::string name = std::string("eles/") + shape.name;
      codec_.push_back(name);
      first_code_[std::size_t(shape.shape)] = int(codec_.size());
      for (std::size_t f = 0; f < faces_of(Sides::Pyfr, shape.shape).size(); ++f)
        codec_.push_back(name + "/" + std::to_string(f));
      const std::vector<int> cgns = cgns_numbers(shape.shape);
      std::vector<int>& back = pyfr_face_[std::size_t(shape.shape)];
      back.resize(cgns.size());
      for (std::size_t f = 0; f < cgns.size(); ++f) back[std::size_t(cgns[f])] = int(f);
      const auto sides = cgns_sides(shape.shape);
      std::vector<std::int16_t>& codes = facet_code_[std::size_t(shape.shape)];
      codes.resize(sides.size());
      for (std::size_t s = 0; s < sides.size(); ++s)
        codes[std::size_t(sides[s].facet)] = std::int16_t(first_code_[std::size_t(shape.shape)] + back[s]);
    }
    std::set<std::string> used;
    for (const SideGroup& group : neighbours_.groups()) {
      group_code_.push_back(group.boundary ? int(codec_.size()) : -1);
      if (group.boundary) codec_.push_back("bc/" + free_name(group, used));
    }
  }

  // === Arrays ==============================================================================================

  /// Writes `count` rows. fill(i, to) puts row i where `to` is.
  template <class Fill>
  void rows(const std::string& path, std::size_t count, std::size_t row_bytes, const Fill& fill) {
    const std::size_t piece = hdf::piece_of(row_bytes);
    std::vector<Fingerprint> parts(chunks_of(count, piece));
    hdf::write_rows<char>(writer_, path, 0, count, 1, row_bytes, team_,
                          [&](std::size_t begin, std::size_t end, char* const to) {
                            char* next = to;
                            for (std::size_t i = begin; i < end; ++i) fill(i, next);
                            parts[begin / piece].update({to, std::size_t(next - to)});
                          });
    for (const Fingerprint& part : parts) digest_.update(part);
  }

  void nodes() {
    const int d = mesh_.dimension;
    writer_.array("/nodes", "{location:f8[" + std::to_string(d) + "],valency:u2}",
                  Dims{std::int64_t(numbers_.node_count())});
    rows("/nodes", numbers_.node_count(), 8 * std::size_t(d) + 2, [&](std::size_t i, char*& to) {
      for (int k = 0; k < d; ++k) put(to, coordinate(numbers_.node_of(i), k));
      put(to, numbers_.valency(numbers_.node_of(i)));
    });
  }

  void elements(const PyfrShape& shape) {
    const std::vector<int>& place = gmsh_nodes(NodeOrder::Rows, shape.shape, mesh_.order);
    const std::vector<int> cgns = cgns_numbers(shape.shape);
    const auto sides = cgns_sides(shape.shape);
    const PyfrNumbers::OwnCells& own = numbers_.own(shape.shape);
    const std::string path = std::string("/eles/") + shape.name;
    writer_.array(path,
                  "{nodes:i8[" + std::to_string(place.size()) + "],curved:b1,faces:{cidx:i2,off:i8}[" +
                      std::to_string(cgns.size()) + "]}",
                  Dims{std::int64_t(own.count)});
    std::vector<char>& is_curved = curved_[shape.shape];
    is_curved.resize(own.count);
    const std::vector<std::array<double, 8>> weights = first_order_weights(shape.shape);
    rows(path, own.count, 8 * place.size() + 1 + 10 * cgns.size(), [&](std::size_t i, char*& to) {
      const std::size_t cell = own[i];
      const auto nodes = cells_.nodes(cell);
      for (const int local : place) put(to, numbers_.number_of(nodes[std::size_t(local)]));
      is_curved[i] = curved(shape.shape, nodes, weights) ? 1 : 0;
      put(to, is_curved[i]);
      const std::size_t first_facet = neighbours_.first_facet(cell);
      for (const int side : cgns) face(first_facet + std::size_t(sides[std::size_t(side)].facet), to);
    });
    find_pairs(own, cgns);
  }

  SideNeighbour neighbour(std::size_t cell, int side) const {
    return neighbours_.of(cell, cgns_sides(cells_.shape(cell))[std::size_t(side)]);
  }

  /// `facet`: the face, counted through all cells.
  void face(std::size_t facet, char*& to) const {
    const std::int64_t other = neighbours_.other_facet(facet);
    if (other < 0) {
      put(to, std::int16_t(group_code_[std::size_t(neighbours_.group_of(facet)) - 1]));
      put(to, std::int64_t(-1));
      return;
    }
    const SideNeighbours::Place place = neighbours_.place_of(std::size_t(other));
    const Shape shape = cells_.ranges()[place.range].block->shape;
    put(to, facet_code_[std::size_t(shape)][std::size_t(place.facet)]);
    put(to, numbers_.index_of(place.cell, place.range));
  }

  /// Each pair of the periodic boundaries stands once, the first side first.
  void find_pairs(const PyfrNumbers::OwnCells& cells, const std::vector<int>& sides) {
    const std::vector<SideGroup>& groups = neighbours_.groups();
    if (std::none_of(groups.begin(), groups.end(), [](const SideGroup& group) { return group.periodic < 0; })) return;
    for (std::size_t i = 0; i < cells.count; ++i)
      for (const int side : sides) {
        const std::size_t cell = cells[i];
        const SideNeighbour other = neighbour(cell, side);
        const int group = other.cell >= 0 && other.group > 0 ? groups[std::size_t(other.group) - 1].periodic : 0;
        if (group >= 0) continue;
        std::string& pairs = pairs_[-group];
        pairs.resize(pairs.size() + 20);
        char* to = pairs.data() + pairs.size() - 20;
        put(to, code(cell, side));
        put(to, numbers_.index_of(cell));
        put(to, code(std::size_t(other.cell), other.side - 1));
        put(to, numbers_.index_of(std::size_t(other.cell)));
      }
  }

  /// The codec's number of a face, which CGNS counts from 0.
  std::int16_t code(std::size_t cell, int side) const {
    const auto shape = std::size_t(cells_.shape(cell));
    return std::int16_t(first_code_[shape] + pyfr_face_[shape][std::size_t(side)]);
  }

  /// Whether the nodes are elsewhere than the map of first order of the vertices puts them, to within rounding.
  bool curved(Shape shape, std::span<const std::int32_t> nodes,
              const std::vector<std::array<double, 8>>& all_weights) const {
    if (mesh_.order == 1) return false;
    const int vertices = reference::info(shape).vertices;
    double size = 0, gap = 0;
    for (int k = 0; k < mesh_.dimension; ++k)
      for (int v = 1; v < vertices; ++v)
        size = std::max(size, std::abs(coordinate(nodes[std::size_t(v)], k) - coordinate(nodes[0], k)));
    for (std::size_t i = std::size_t(vertices); i < nodes.size(); ++i) {
      const std::array<double, 8>& weights = all_weights[i];
      for (int k = 0; k < mesh_.dimension; ++k) {
        double x = 0;
        for (int v = 0; v < vertices; ++v) x += weights[std::size_t(v)] * coordinate(nodes[std::size_t(v)], k);
        gap = std::max(gap, std::abs(x - coordinate(nodes[i], k)));
      }
    }
    return gap > 1e-12 * size;
  }

  /// The functions of first order at every node.
  std::vector<std::array<double, 8>> first_order_weights(Shape shape) const {
    std::vector<std::array<double, 8>> weights;
    for (const auto& at : reference::lattice(shape, mesh_.order)) weights.push_back(first_order(shape, at));
    return weights;
  }

  /// The functions of first order at a position of the lattice, one per vertex. The pyramid's have a fraction.
  std::array<double, 8> first_order(Shape shape, const std::array<std::int8_t, 3>& at) const {
    const double n = mesh_.order, x = at[0] / n, y = at[1] / n, z = at[2] / n;
    switch (shape) {
      case Shape::Triangle:
        return {1 - x - y, x, y};
      case Shape::Quadrilateral:
        return {(1 - x) * (1 - y), x * (1 - y), x * y, (1 - x) * y};
      case Shape::Tetrahedron:
        return {1 - x - y - z, x, y, z};
      case Shape::Prism:
        return {(1 - x - y) * (1 - z), x * (1 - z), y * (1 - z), (1 - x - y) * z, x * z, y * z};
      case Shape::Pyramid: {
        const double h = 1 - z, a = h > 0 ? x / h : 0, b = h > 0 ? y / h : 0;
        return {(1 - a) * (1 - b) * h, a * (1 - b) * h, a * b * h, (1 - a) * b * h, z};
      }
      default:
        return {(1 - x) * (1 - y) * (1 - z), x * (1 - y) * (1 - z), x * y * (1 - z), (1 - x) * y * (1 - z),
                (1 - x) * (1 - y) * z,       x * (1 - y) * z,       x * y * z,       (1 - x) * y * z};
    }
  }

  void periodic() {
    if (pairs_.empty()) return;
    writer_.group("/periodic");
    for (const auto& [number, bytes] : pairs_)
      writer_.array("/periodic/" + std::to_string(number), "{cidx:i2,off:i8}", Dims{std::int64_t(bytes.size() / 20), 2},
                    bytes);
  }

  /// One part, with the curved elements of each shape first.
  void partitioning() {
    std::vector<std::int64_t> regions{0};
    for (const PyfrShape& shape : kPyfrShapes)
      if (const auto count = std::int64_t(numbers_.own(shape.shape).count); count > 0)
        regions.push_back(regions.back() + count);
    writer_.group("/partitionings");
    writer_.group("/partitionings/1");
    const std::string path = "/partitionings/1/eles";
    writer_.array(path, "i8", Dims{regions.back()});
    std::int64_t row = 0;
    std::vector<std::int64_t> piece;
    const auto flush = [&] {
      if (!piece.empty()) writer_.rows(path, row, std::int64_t(piece.size()), hdf::bytes_of(piece));
      row += std::int64_t(piece.size());
      piece.clear();
    };
    for (const PyfrShape& shape : kPyfrShapes)
      for (const bool wanted : {true, false}) {
        const std::vector<char>& is_curved = curved_[shape.shape];
        for (std::size_t i = 0; i < is_curved.size(); ++i) {
          if ((is_curved[i] != 0) == wanted) piece.push_back(std::int64_t(i));
          if (piece.size() == hdf::piece_of(sizeof piece[0])) flush();
        }
      }
    flush();
    writer_.attribute(path, "regions", "i8", Dims{1, std::int64_t(regions.size())}, hdf::bytes_of(regions));
  }

  void text(const char* path, const std::string& value) {
    writer_.array(path, "S" + std::to_string(value.size()), {}, value);
  }

  void names() {
    std::size_t width = 1;
    for (const std::string& name : codec_) width = std::max(width, name.size());
    std::string all;
    for (std::string name : codec_) {
      digest_.update(name);
      name.resize(width, '\0');
      all += name;
    }
    writer_.array("/codec", "S" + std::to_string(width), Dims{std::int64_t(codec_.size())}, all);
    text("/creator", "varimesh");
    text("/mesh-uuid", digest_.uuid());
    writer_.array("/version", "i8", {}, hdf::bytes_of(std::vector<std::int64_t>{1}));
  }

  const HighOrderMesh& mesh_;
  const Team& team_;
  Cells cells_;
  SideNeighbours neighbours_;
  PyfrNumbers numbers_;
  hdf::Writer& writer_;
  Fingerprint digest_;
  std::int64_t skew_base_ = 0;
  std::vector<std::string> codec_;
  std::array<int, kShapes> first_code_{};                        // of the faces of a shape
  std::array<std::vector<int>, kShapes> pyfr_face_{};            // by the number in CGNS's order
  std::array<std::vector<std::int16_t>, kShapes> facet_code_{};  // by the number in ShapeInfo::facets
  std::vector<int> group_code_;                                  // by group; −1: no boundary condition
  std::map<Shape, std::vector<char>> curved_;                    // whether each cell of a shape is curved
  std::map<int, std::string> pairs_;                             // by periodic link
};

}  // namespace

Expected<void> write_pyfr(const HighOrderMesh& mesh, hdf::Writer& writer, const Team& team) {
  bool flat = mesh.dimension > 2;
  if (mesh.dimension == 2) {
    flat = true;
    for (std::size_t i = 2; i < mesh.coordinates.size(); i += 3)
      flat = flat && mesh.coordinates[i] == mesh.coordinates[2];
  }
  if (!flat) return bad_option("PyFR takes meshes of a plane z = constant and of solids only; write vtu.");
  return Writing(mesh, writer, team).write();
}

}  // namespace varimesh::formats
