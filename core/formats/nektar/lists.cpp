// The lists of a Nektar++ file: finds entries by their ids, sorts and checks them, and finds the vertices of faces and
// cells.
#include <algorithm>
#include <limits>

#include "core/base/io/scanner.h"
#include "core/formats/nektar/file.h"
#include "core/formats/nektar/nektar.h"
#include "core/formats/numbering/sides.h"

namespace varimesh::formats {

void NektarIds::add(std::int64_t id) {
  if (ids_.empty() && id != std::int64_t(count_))
    for (std::size_t i = 0; i < count_; ++i) ids_.push_back(std::int64_t(i));
  if (!ids_.empty() || id != std::int64_t(count_)) ids_.push_back(id);
  ++count_;
}

bool NektarIds::finish(std::int64_t& twice) {
  if (are_consecutive()) return true;
  for (std::size_t i = 0; i < ids_.size(); ++i) sorted_.emplace_back(ids_[i], std::int32_t(i));
  std::sort(sorted_.begin(), sorted_.end());
  const auto same = [](const auto& a, const auto& b) { return a.first == b.first; };
  const auto found = std::adjacent_find(sorted_.begin(), sorted_.end(), same);
  if (found != sorted_.end()) twice = found->first;
  return found == sorted_.end();
}

std::int32_t NektarIds::find(std::int64_t id) const {
  if (sorted_.empty()) return id >= 0 && id < std::int64_t(count_) ? std::int32_t(id) : -1;
  const auto found = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(id, std::int32_t(-1)));
  return found == sorted_.end() || found->first != id ? -1 : found->second;
}

void sort_parts(NektarParts& parts) {
  bool is_sorted = true;
  for (std::size_t e = 1; e < parts.ids.size(); ++e) is_sorted = is_sorted && parts.ids[e - 1] <= parts.ids[e];
  if (is_sorted) return;
  std::vector<std::pair<std::int64_t, std::size_t>> order;  // number, position
  std::vector<std::size_t> first;                           // of its sides
  std::size_t sides = 0;
  for (std::size_t e = 0; e < parts.ids.size(); ++e) {
    order.emplace_back(parts.ids[e], e);
    first.push_back(sides);
    sides += std::size_t(nektar_sides(parts.shapes[e]));
  }
  std::sort(order.begin(), order.end());
  NektarParts sorted;
  for (const auto& [number, at] : order) {
    sorted.ids.add(number);
    sorted.shapes.push_back(parts.shapes[at]);
    const auto begin = parts.sides.begin() + std::ptrdiff_t(first[at]);
    sorted.sides.insert(sorted.sides.end(), begin, begin + nektar_sides(parts.shapes[at]));
  }
  parts = std::move(sorted);
}

void check_nektar_points(const NektarFile& file, bool keeps_points) {
  const std::size_t indices = file.indices;
  const Scanner scan(file.bytes);
  // Points that are not kept are counted when they are read.
  const std::size_t points = keeps_points ? file.points.size() / 3 : std::numeric_limits<std::int32_t>::max();
  const std::size_t most = indices == 0 ? points : file.index.empty() ? std::min(points, indices) : indices;
  for (const std::vector<NektarCurve>* curves : {&file.curved_edges, &file.curved_faces})
    for (const NektarCurve& curve : *curves)
      if (std::size_t(curve.count) > most || curve.first > most - std::size_t(curve.count))
        scan.fail("the curve of " + std::to_string(curve.id) + " has points that are not in the file");
  for (const std::int32_t number : file.index)
    if (std::size_t(number) >= points)
      scan.fail("a curve refers to point " + std::to_string(number) + ", but there are " + std::to_string(points));
}

int nektar_sides(Shape shape) {
  constexpr std::array kSides = {0, 2, 3, 4, 4, 5, 5, 6};
  return kSides[std::size_t(shape)];
}

char nektar_letter(Shape shape) { return "VETQAPRH"[std::size_t(shape)]; }

// === Vertices of faces and cells =========================================================================

namespace {

using Vertices = std::array<std::int32_t, 8>;

/// What an entry is called in a sentence.
struct Name {
  const char* kind;
  std::int64_t id;
  std::string operator()() const { return kind + std::to_string(id); }
};

class Finder {
 public:
  Finder(NektarFile& file, FileAllowance& allowance) : file_(file), allowance_(allowance) {}

  NektarCorners take() {
    resolve_edges();
    find_vertices();
    return std::move(made_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const { Scanner(file_.bytes).fail(what); }

  void resolve_edges() {
    for (std::size_t e = 0; e < file_.edge_ids.size(); ++e) {
      for (std::size_t k = 0; k < 2; ++k) {
        const std::int32_t vertex = file_.vertex_ids.find(file_.edges[2 * e + k]);
        if (vertex < 0)
          fail("edge " + std::to_string(file_.edge_ids[e]) + " refers to vertex " +
               std::to_string(file_.edges[2 * e + k]) + ", which is not in the file");
        file_.edges[2 * e + k] = vertex;
      }
      if (file_.edges[2 * e] == file_.edges[2 * e + 1])
        fail("edge " + std::to_string(file_.edge_ids[e]) + " has the same vertex twice");
    }
  }

  /// The vertices of a face from its edges: vertex k is common to edge k and the edge before.
  Vertices around(const Name& name, std::span<const std::int32_t> edges) const {
    std::array<std::array<std::int64_t, 2>, 4> ends{};
    for (std::size_t k = 0; k < edges.size(); ++k) {
      const std::int32_t edge = file_.edge_ids.find(edges[k]);
      if (edge < 0) fail(name() + " refers to edge " + std::to_string(edges[k]) + ", which is not in the file");
      ends[k] = {file_.edges[2 * std::size_t(edge)], file_.edges[2 * std::size_t(edge) + 1]};
    }
    Vertices vertices{};
    for (std::size_t k = 0; k < edges.size(); ++k) {
      const auto& before = ends[(k + edges.size() - 1) % edges.size()];
      const bool first = ends[k][0] == before[0] || ends[k][0] == before[1];
      const bool second = ends[k][1] == before[0] || ends[k][1] == before[1];
      if (first == second) fail("the edges of " + name() + " do not go around it");
      vertices[k] = std::int32_t(ends[k][first ? 0 : 1]);
    }
    for (std::size_t k = 0; k < edges.size(); ++k)
      if (std::count(vertices.begin(), vertices.begin() + std::ptrdiff_t(edges.size()), vertices[k]) > 1)
        fail("the edges of " + name() + " do not go around it");
    return vertices;
  }

  /// The vertices of a cell from its faces: each vertex is the one that lies on the faces on which it should lie.
  Vertices of_cell(const Name& name, Shape shape, std::span<const std::int32_t> sides) const {
    const std::span<const reference::Facet> faces = faces_of(Sides::Nektar, shape);
    std::array<unsigned, 8> wanted{};
    std::array<std::pair<std::int32_t, unsigned>, 24> found;  // a vertex, and the faces on which it lies
    std::size_t known_count = 0;
    for (std::size_t f = 0; f < sides.size(); ++f) {
      const std::int32_t face = file_.faces.ids.find(sides[f]);
      if (face < 0) fail(name() + " refers to face " + std::to_string(sides[f]) + ", which is not in the file");
      if (file_.faces.shapes[std::size_t(face)] != faces[f].shape)
        fail("face " + std::to_string(f) + " of " + name() + " has the wrong shape");
      for (std::size_t k = 0; k < std::size_t(reference::info(faces[f].shape).vertices); ++k) {
        wanted[std::size_t(faces[f].vertices[k])] |= 1U << f;
        const std::int32_t vertex = made_.faces[made_.per_face * std::size_t(face) + k];
        std::size_t known = 0;
        while (known < known_count && found[known].first != vertex) ++known;
        if (known == known_count) found[known_count++] = {vertex, 0U};
        found[known].second |= 1U << f;
      }
    }
    Vertices vertices{};
    const auto count = std::size_t(reference::info(shape).vertices);
    for (std::size_t v = 0; v < count; ++v) {
      std::size_t one = 0;
      while (one < known_count && found[one].second != wanted[v]) ++one;
      if (one == known_count || known_count != count) fail("the faces of " + name() + " do not enclose it");
      vertices[v] = found[one].first;
    }
    return vertices;
  }

  void find_vertices() {
    const auto is_triangle = [](Shape shape) { return shape == Shape::Triangle; };
    if (std::all_of(file_.faces.shapes.begin(), file_.faces.shapes.end(), is_triangle)) made_.per_face = 3;
    allowance_.take(file_.faces.ids.size(), made_.per_face * sizeof(std::int32_t));
    made_.faces.reserve(made_.per_face * file_.faces.ids.size());
    const std::int32_t* sides = file_.faces.sides.data();
    for (std::size_t f = 0; f < file_.faces.ids.size(); ++f) {
      const auto count = std::size_t(nektar_sides(file_.faces.shapes[f]));
      const Vertices own = around({"face ", file_.faces.ids[f]}, {sides, count});
      made_.faces.insert(made_.faces.end(), own.begin(), own.begin() + std::ptrdiff_t(made_.per_face));
      sides += count;
    }
    free_memory(file_.faces.sides);
    std::size_t vertices = 0;
    for (const Shape shape : file_.elements.shapes) vertices += std::size_t(reference::info(shape).vertices);
    allowance_.take(vertices, sizeof(std::int32_t));
    made_.cells.reserve(vertices);
    sides = file_.elements.sides.data();
    for (std::size_t e = 0; e < file_.elements.ids.size(); ++e) {
      const Shape shape = file_.elements.shapes[e];
      const std::span own(sides, std::size_t(nektar_sides(shape)));
      const Name name{"element ", file_.elements.ids[e]};
      const Vertices vertices = file_.dimension == 2 ? around(name, own) : of_cell(name, shape, own);
      const auto count = std::ptrdiff_t(reference::info(shape).vertices);
      allowance_.look();
      made_.cells.insert(made_.cells.end(), vertices.begin(), vertices.begin() + count);
      sides += own.size();
    }
    free_memory(file_.elements.sides);
    return_freed_memory();
  }

  NektarFile& file_;
  FileAllowance& allowance_;
  NektarCorners made_;
};

}  // namespace

NektarCorners nektar_corners(NektarFile& file, FileAllowance& allowance) { return Finder(file, allowance).take(); }

}  // namespace varimesh::formats
