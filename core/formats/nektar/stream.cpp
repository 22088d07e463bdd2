// Places nodes by the points of curves, which are read one after another and never all in memory.
#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>

#include "core/base/io/scanner.h"
#include "core/formats/mfem/space.h"
#include "core/formats/nektar/place.h"
#include "core/formats/numbering/node_order.h"

namespace varimesh::formats {

namespace {

class Finder {
 public:
  Finder(const NektarFile& file, const NektarCorners& corners, const MfemTopology& topology, int order,
         FileAllowance& allowance)
      : file_(file), corners_(corners), topology_(topology), order_(order), allowance_(allowance) {}

  std::optional<NektarPointNodes> take(const std::function<NektarCell(std::int32_t)>& cell_of) {
    if (has_both_kinds())
      Scanner(file_.bytes)
          .fail(
              "some curves have points of their own, and others refer to a list of points; let the program that made "
              "the mesh write it again");
    if (file_.has_texts() && !file_.points_text.empty()) return std::nullopt;
    make_room();
    for (const NektarCurve& curve : file_.curved_edges) {
      const std::int32_t edge = file_.edge_ids.find(curve.id);
      if (edge < 0)
        Scanner(file_.bytes)
            .fail("the curve of edge " + std::to_string(curve.id) + " is of an edge that is not in the file");
      const std::array vertices = {file_.edges[2 * std::size_t(edge)], file_.edges[2 * std::size_t(edge) + 1]};
      if (!add(Shape::Line, curve, {vertices, 0})) return std::nullopt;
    }
    const bool solid = file_.dimension == 3;
    const NektarParts& faces = solid ? file_.faces : file_.elements;
    for (const NektarCurve& curve : file_.curved_faces) {
      const std::int32_t face = faces.ids.find(curve.id);
      const Shape shape = faces.shapes[std::size_t(face)];
      const NektarCell own = solid ? NektarCell{corners_.face(std::size_t(face), shape), 0} : cell_of(face);
      if (!add(shape, curve, own)) return std::nullopt;
    }
    made_.placed.assign(nodes_, false);
    for (const std::int32_t node : made_.nodes) {
      if (node < 0) continue;
      if (made_.placed[std::size_t(node)]) return std::nullopt;  // an edge or face has two curves
      made_.placed[std::size_t(node)] = true;
    }
    return std::move(made_);
  }

  void set_node_count(std::size_t nodes) { nodes_ = nodes; }

 private:
  /// Whether some curves have points of their own, and others refer to a list of points.
  bool has_both_kinds() const {
    const std::size_t texts = file_.edge_texts.size() + file_.face_texts.size();
    return texts > 0 && texts != file_.curved_edges.size() + file_.curved_faces.size();
  }

  /// For all points, if they are one after another.
  void make_room() {
    std::size_t all = file_.index.empty() ? file_.indices : 0;
    if (file_.has_texts())
      for (const auto* texts : {&file_.edge_texts, &file_.face_texts})
        for (const NektarCurveText& text : *texts) all += std::size_t(text.count);
    allowance_.take(all, sizeof(std::int32_t));
    made_.nodes.reserve(all);
  }

  /// Returns false if the points of this curve must be in memory.
  bool add(Shape shape, const NektarCurve& curve, const NektarCell& own) {
    if (curve.points != NektarPoints::EvenlySpaced || curve.count != reference::node_count(shape, order_)) return false;
    const std::size_t first = file_.has_texts() ? next_ : curve.first;
    next_ += std::size_t(curve.count);
    nodes_of_curve_.resize(std::size_t(curve.count));
    if (!topology_.find_nodes(shape, own.vertices, own.interior, nodes_of_curve_)) return true;  // no cell has it
    const std::vector<int>& order = gmsh_nodes(NodeOrder::Nektar, shape, order_);
    const int boundary = curve.count - inner_node_count(shape, order_);
    for (std::size_t k = 0; k < order.size(); ++k) {
      const std::int32_t node = nodes_of_curve_[std::size_t(order[k])];
      if (!set(file_.number_of_point(first + k), node, order[k] >= boundary)) return false;
    }
    return true;
  }

  bool set(std::size_t point, std::int32_t node, bool places) {
    std::vector<std::int32_t>& nodes = made_.nodes;
    if (point >= nodes.size()) {
      const std::size_t before = nodes.capacity();
      const std::size_t size = std::max(point + 1, point < before ? before : before + before / 2);
      if (size > before) {
        allowance_.take(size, sizeof(std::int32_t));
        nodes.reserve(size);
        allowance_.give_back(before * sizeof(std::int32_t));
      }
      nodes.resize(point + 1, NektarPointNodes::kNoNode);
    }
    std::int32_t& known = nodes[point];
    const std::int32_t meets = NektarPointNodes::kMeets - node;
    if (known != NektarPointNodes::kNoNode && known != node && known != meets) return false;
    known = places || known == node ? node : meets;
    return true;
  }

  const NektarFile& file_;
  const NektarCorners& corners_;
  const MfemTopology& topology_;
  const int order_;
  FileAllowance& allowance_;
  NektarPointNodes made_;
  std::vector<std::int32_t> nodes_of_curve_;
  std::size_t next_ = 0, nodes_ = 0;
};

/// Places the node of a point, or looks whether it is there.
class Placer {
 public:
  Placer(const NektarPointNodes& points, HighOrderMesh& mesh) : points_(points), mesh_(mesh) {}

  bool place(std::size_t point, const double* x) const {
    const std::int32_t code = point < points_.nodes.size() ? points_.nodes[point] : NektarPointNodes::kNoNode;
    if (code == NektarPointNodes::kNoNode) return true;
    const bool places = code >= 0;
    double* const own = mesh_.coordinates.data() + 3 * std::size_t(places ? code : NektarPointNodes::kMeets - code);
    if (places) {
      std::copy(x, x + 3, own);
      return true;
    }
    // Files have at least six digits. Those that round otherwise are read with their points in memory.
    constexpr double kRounding = 1e-6;
    double gap = 0, size = 0;
    for (int k = 0; k < 3; ++k) {
      gap = std::max(gap, std::abs(x[k] - own[k]));
      size = std::max(size, std::abs(x[k]));
    }
    return gap <= kRounding * size;
  }

 private:
  const NektarPointNodes& points_;
  HighOrderMesh& mesh_;
};

bool place_packed(const NektarFile& file, const Placer& placer, std::size_t wanted, FileAllowance& allowance) {
  std::size_t point = 0;
  bool meet = true;
  for (const XmlText& text : file.points_text)
    unpack_nektar(file.bytes, text, sizeof(NektarPackedPoint), [&](std::string_view bytes, std::size_t) {
      allowance.look();
      Scanner scan(file.bytes);
      scan.go_to(text.begin);
      for (std::size_t at = 0; at < bytes.size(); at += sizeof(NektarPackedPoint)) {
        NektarPackedPoint own;
        std::memcpy(&own, bytes.data() + at, sizeof own);
        for (const double each : own.x) scan.finite(each, [&] { return nektar_packed_point(point); });
        meet = placer.place(point++, own.x) && meet;
      }
    });
  if (point < wanted)
    Scanner(file.bytes)
        .fail("a curve refers to point " + std::to_string(wanted - 1) + ", but there are " + std::to_string(point));
  return meet;
}

/// Reads the text of a curve, the first of whose points has the number `point`, which moves behind the last. Returns
/// whether all points that must meet others do.
bool place_text(const NektarFile& file, const NektarCurveText& text, std::size_t& point, const Placer& placer) {
  Scanner scan(file.bytes.substr(0, text.begin + text.length));
  scan.go_to(text.begin);
  bool meet = true;
  for (std::int32_t k = 0; k < text.count; ++k) {
    double x[3];
    for (double& each : x) each = scan.finite(scan.text_number("a coordinate of a curve"), nektar_curve_point);
    meet = placer.place(point++, x) && meet;
  }
  scan.skip_space();
  if (!scan.at_end()) scan.fail("more numbers follow than the element has");
  return meet;
}

/// Reads the texts of curves, the first of whose points has the number `first`. Returns the number behind the last.
std::size_t place_texts(const NektarFile& file, const std::vector<NektarCurveText>& texts, std::size_t first,
                        const Placer& placer, const Team& team, std::atomic<bool>& meet) {
  constexpr std::size_t kTextsPerTask = 4096;
  std::vector<std::size_t> begins;  // the first point of each task
  for (std::size_t i = 0; i < texts.size(); ++i) {
    if (i % kTextsPerTask == 0) begins.push_back(first);
    first += std::size_t(texts[i].count);
  }
  FirstFault fault;
  for_chunks(team, texts.size(), kTextsPerTask, [&](std::size_t chunk, std::size_t begin, std::size_t end) {
    fault.guard(chunk, [&] {
      std::size_t point = begins[chunk];
      for (std::size_t i = begin; i < end; ++i)
        if (!place_text(file, texts[i], point, placer)) meet = false;
    });
  });
  fault.throw_it();
  return first;
}

}  // namespace

std::optional<NektarPointNodes> nektar_point_nodes(const NektarFile& file, const NektarCorners& corners,
                                                   const MfemTopology& topology, int order, std::size_t nodes,
                                                   const std::function<NektarCell(std::int32_t element)>& cell_of,
                                                   FileAllowance& allowance) {
  Finder finder(file, corners, topology, order, allowance);
  finder.set_node_count(nodes);
  return finder.take(cell_of);
}

bool place_nektar_points(const NektarFile& file, const NektarPointNodes& points, HighOrderMesh& mesh,
                         FileAllowance& allowance, const Team& team) {
  const Placer placer(points, mesh);
  if (!file.has_texts()) return place_packed(file, placer, points.nodes.size(), allowance);
  std::atomic<bool> meet = true;
  // Points of faces must meet those of edges.
  const std::size_t faces = place_texts(file, file.edge_texts, 0, placer, team, meet);
  place_texts(file, file.face_texts, faces, placer, team, meet);
  return meet;
}

}  // namespace varimesh::formats
