// Faces of a 3-D mesh on lattices of points: those on the boundary, and all faces of the worst cells.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "client/report/face_distances.h"
#include "client/report/scene.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::client {
namespace {

using Json = nlohmann::ordered_json;

// These limits keep a page small enough to send by mail, and fast enough to turn without a graphics card.
constexpr std::size_t kMostPoints = 100'000;  ///< In one set of faces. More faces get fewer intervals per edge.
constexpr std::size_t kAllCells = 4000;       ///< In meshes with up to this many cells, all cells have curved faces.
constexpr std::size_t kWorstCells = 2000;     ///< In larger meshes, this many of the worst cells of each snapshot are.

constexpr std::size_t kFirstCut = 1;  ///< The axis of the cut that the page begins with.

struct Face {
  std::size_t cell;
  int facet;
};

/// The points of the lattice on a face, row by row; the second coordinate is constant in a row. page/lattices.js relies
/// on this order.
reference::Points face_lattice(Shape shape, int intervals) {
  const bool triangle = shape == Shape::Triangle;
  std::vector<std::array<double, 2>> places;
  for (int j = 0; j <= intervals; ++j)
    for (int i = 0; i <= (triangle ? intervals - j : intervals); ++i)
      places.push_back({-1 + 2.0 * i / intervals, -1 + 2.0 * j / intervals});
  reference::Points points(static_cast<Eigen::Index>(places.size()), 2);
  for (std::size_t i = 0; i < places.size(); ++i)
    points.row(static_cast<Eigen::Index>(i)) << places[i][0], places[i][1];
  return points;
}

/// The number of intervals per edge: enough for curves to look smooth, but not more than kMostPoints points in all.
int intervals_for(std::size_t faces, int order) {
  if (order == 1) return 1;
  int intervals = std::min(2 * order, 12);
  const auto points = [&] { return faces * static_cast<std::size_t>((intervals + 1) * (intervals + 2) / 2); };
  while (intervals > 1 && points() > kMostPoints) --intervals;
  return intervals;
}

/// Packs faces of one shape: for each face its first vertex, a scale, and the points of its lattice relative to the
/// vertex, as 16-bit integers in units of the scale.
void pack_faces(const Snapshots& snapshots, std::size_t snapshot, const std::vector<Face>& faces, Shape shape,
                int intervals, const std::string& name, Packing* packing) {
  const int order = snapshots.mesh().order;
  const auto values =
      reference::basis_values(shape, order, reference::NodeSet::Equispaced, 3, face_lattice(shape, intervals));
  std::vector<float> origins, scales;
  std::vector<std::int16_t> steps;
  Eigen::MatrixXd nodes(values.cols(), 3);
  for (const Face& face : faces) {
    const auto& local = reference::facet_nodes(snapshots.cells().shape(face.cell), order, face.facet);
    for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
      const auto node = snapshots.point(snapshot, face.cell, local[static_cast<std::size_t>(i)]);
      for (std::size_t d = 0; d < 3; ++d) nodes(i, static_cast<Eigen::Index>(d)) = node[d] - snapshots.centre()[d];
    }
    const Eigen::RowVector3d origin = nodes.row(0);
    nodes.rowwise() -= origin;
    const Eigen::MatrixXd points = values * nodes;
    const double largest = std::max(points.cwiseAbs().maxCoeff(), 1e-300);
    for (Eigen::Index d = 0; d < 3; ++d) origins.push_back(static_cast<float>(origin(d)));
    scales.push_back(static_cast<float>(largest / 32767));
    for (Eigen::Index i = 0; i < points.rows(); ++i)
      for (Eigen::Index d = 0; d < 3; ++d)
        steps.push_back(static_cast<std::int16_t>(std::lround(points(i, d) / largest * 32767)));
  }
  packing->add(name + "_origins", origins);
  packing->add(name + "_scales", scales);
  packing->add(name + "_steps", steps);
}

/// The cells that are shown whole. Every cell with a scaled Jacobian up to `limit` in either snapshot is among them.
std::vector<std::int32_t> choose_cells(const Snapshots& snapshots, double* limit) {
  std::vector<std::int32_t> chosen;
  *limit = 1;
  if (snapshots.cells().count() <= kAllCells) return snapshots.worst(0, snapshots.cells().count());
  std::vector<bool> taken(snapshots.cells().count());
  for (std::size_t s = 0; s < snapshots.count(); ++s) {
    const auto worst = snapshots.worst(s, kWorstCells);
    *limit = std::min(*limit, snapshots[s].scaled_jacobian[static_cast<std::size_t>(worst.back())]);
    for (const std::int32_t cell : worst) {
      if (!taken[static_cast<std::size_t>(cell)]) chosen.push_back(cell);
      taken[static_cast<std::size_t>(cell)] = true;
    }
  }
  return chosen;
}

/// The cells that are shown, in the order in which the arrays have them.
class ShownCells {
 public:
  ShownCells(std::size_t cell_count, std::vector<std::int32_t>* shown) : index_of_(cell_count, -1), shown_(shown) {}

  void add(std::size_t cell) {
    if (index_of_[cell] >= 0) return;
    index_of_[cell] = static_cast<std::int32_t>(shown_->size());
    shown_->push_back(static_cast<std::int32_t>(cell));
  }
  std::int32_t index_of(std::size_t cell) const { return index_of_[cell]; }

 private:
  std::vector<std::int32_t> index_of_;  ///< −1: the cell is not shown.
  std::vector<std::int32_t>* shown_;
};

/// Whether a node of these faces is at another place in the last snapshot than in the first. Formats round coordinates,
/// so smaller movements count as none.
bool has_moved(const Snapshots& snapshots, const std::vector<Face>& faces) {
  constexpr double kRounding = 1e-6;
  const auto& box = snapshots.box();
  const double most = kRounding * std::hypot(box[3] - box[0], box[4] - box[1], box[5] - box[2]);
  for (const Face& face : faces)
    for (const int local :
         reference::facet_nodes(snapshots.cells().shape(face.cell), snapshots.mesh().order, face.facet)) {
      const auto first = snapshots.point(0, face.cell, local);
      const auto last = snapshots.point(snapshots.count() - 1, face.cell, local);
      for (std::size_t d = 0; d < 3; ++d)
        if (std::abs(first[d] - last[d]) > most) return true;
    }
  return false;
}

/// Packs the surfaces of faces on the boundary, and their distances from the CAD model.
void pack_distances(const Snapshots& snapshots, const std::vector<Face>& faces, const FaceDistances& known,
                    const std::string& name, Packing* packing) {
  std::vector<std::int32_t> surfaces;
  for (const Face& face : faces) surfaces.push_back(known.surface(face.cell, face.facet));
  packing->add(name + "_surfaces", surfaces);
  for (std::size_t s = 0; s < snapshots.count(); ++s) {
    std::vector<float> distances;
    for (const Face& face : faces) distances.push_back(known.distance(s, face.cell, face.facet));
    packing->add(name + "_distances_" + Snapshots::name(s), distances);
  }
}

/// Packs one set of faces, the triangles and the quadrilaterals apart, and describes them in `sets`. `kept` is the
/// number of snapshots in which the faces differ.
void pack_face_set(const Snapshots& snapshots, const std::string& set, const std::vector<Face>& faces, std::size_t kept,
                   const FaceDistances& known, const ShownCells& shown, Packing* packing, Json* sets) {
  const int intervals = intervals_for(faces.size(), snapshots.mesh().order);
  for (const Shape shape : {Shape::Triangle, Shape::Quadrilateral}) {
    std::vector<Face> of_shape;
    std::vector<std::int32_t> owners;
    for (const Face& face : faces) {
      const auto& info = reference::info(snapshots.cells().shape(face.cell));
      if (info.facets[static_cast<std::size_t>(face.facet)].shape != shape) continue;
      of_shape.push_back(face);
      owners.push_back(shown.index_of(face.cell));
    }
    if (of_shape.empty()) continue;
    const int corners = shape == Shape::Triangle ? 3 : 4;
    const std::string name = set + std::to_string(corners);
    for (std::size_t s = 0; s < kept; ++s)
      pack_faces(snapshots, s, of_shape, shape, intervals, name + "_" + Snapshots::name(s), packing);
    packing->add(name + "_cells", owners);
    if (known.any()) pack_distances(snapshots, of_shape, known, name, packing);
    sets->push_back(
        {{"name", name}, {"set", set}, {"corners", corners}, {"intervals", intervals}, {"snapshots", kept}});
  }
}

}  // namespace

Json pack_cells_3d(const Snapshots& snapshots, const BoundaryDistanceArrays& distances, Packing* packing, Packing* more,
                   std::vector<std::int32_t>* shown_cells) {
  const Cells& cells = snapshots.cells();
  const Facets sides = facets(snapshots.mesh());
  double limit = 1;
  const std::vector<std::int32_t> whole = choose_cells(snapshots, &limit);
  ShownCells shown(cells.count(), shown_cells);
  std::vector<Face> skin, inner;
  for (const std::int32_t chosen : whole) {
    const auto c = static_cast<std::size_t>(chosen);
    shown.add(c);
    for (int f = 0; f < static_cast<int>(reference::info(cells.shape(c)).facets.size()); ++f) inner.push_back({c, f});
  }
  for (std::size_t c = 0; c < cells.count(); ++c)
    for (std::int32_t side = sides.first[c]; side < sides.first[c + 1]; ++side)
      if (sides.neighbour[static_cast<std::size_t>(side)] < 0) {
        shown.add(c);
        skin.push_back({c, side - sides.first[c]});
      }

  Json sets = Json::array();
  const FaceDistances known(snapshots, distances);
  // Nodes on the boundary move only if they slid on a CAD model. Otherwise one snapshot of the skin is enough.
  const std::size_t of_skin = has_moved(snapshots, skin) ? snapshots.count() : 1;
  pack_face_set(snapshots, "skin", skin, of_skin, known, shown, packing, &sets);
  pack_face_set(snapshots, "inner", inner, snapshots.count(), known, shown, packing, &sets);
  std::vector<float> middles;
  for (const std::int32_t cell : *shown_cells)
    for (std::size_t d = 0; d < 3; ++d)
      middles.push_back(
          static_cast<float>(snapshots.middle(0, static_cast<std::size_t>(cell))[d] - snapshots.centre()[d]));
  packing->add("middles", middles);
  const bool cuts_need_corners = whole.size() < cells.count();
  if (cuts_need_corners) {
    std::vector<std::size_t> all(cells.count());
    std::iota(all.begin(), all.end(), std::size_t{0});
    pack_corners(snapshots, cells_cut_in_the_middle(snapshots, kFirstCut), "cut", packing);
    pack_corners(snapshots, all, "all", more);
  }
  return {{"sets", sets},           {"whole", whole.size()},    {"whole_up_to", limit},
          {"first_cut", kFirstCut}, {"distances", known.any()}, {"corners", cuts_need_corners}};
}

}  // namespace varimesh::client
