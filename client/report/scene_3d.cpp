// Faces of a 3-D mesh on lattices: the boundary's, and all faces of the worst cells.
#include <algorithm>
#include <cmath>

#include "client/report/scene.h"
#include "core/reference/basis.h"
#include "core/reference/nodes.h"

namespace varimesh::client {
namespace {

using Json = nlohmann::ordered_json;

// A page that is sent about should stay small, and turn without a graphics card too.
constexpr std::size_t kMostPoints = 100'000;  ///< Of all faces in one set; fewer intervals an edge keep to it.
constexpr std::size_t kAllCells = 4000;       ///< Up to so many, every cell is there whole.
constexpr std::size_t kWorstCells = 2000;     ///< Of more, these are, in each stage.

struct Face {
  std::size_t cell;
  int facet;
};

/// Points of a face's lattice, row by row: the second coordinate is constant in a row. page/lattices.js knows the
/// order.
reference::Points face_lattice(Shape shape, int intervals) {
  const bool triangle = shape == Shape::Triangle;
  std::vector<std::array<double, 2>> at;
  for (int j = 0; j <= intervals; ++j)
    for (int i = 0; i <= (triangle ? intervals - j : intervals); ++i)
      at.push_back({-1 + 2.0 * i / intervals, -1 + 2.0 * j / intervals});
  reference::Points points(static_cast<Eigen::Index>(at.size()), 2);
  for (std::size_t i = 0; i < at.size(); ++i) points.row(static_cast<Eigen::Index>(i)) << at[i][0], at[i][1];
  return points;
}

/// So many intervals an edge that curves look smooth, as long as all the points are not too many.
int intervals_for(std::size_t faces, int order) {
  if (order == 1) return 1;
  int intervals = std::min(2 * order, 12);
  const auto points = [&] { return faces * static_cast<std::size_t>((intervals + 1) * (intervals + 2) / 2); };
  while (intervals > 1 && points() > kMostPoints) --intervals;
  return intervals;
}

/// Packs faces of one shape: for each its first vertex, a scale, and the lattice's points in sixteen bits of that.
void pack_faces(const Stages& stages, std::size_t stage, const std::vector<Face>& faces, Shape shape, int intervals,
                const std::string& name, Packing* packing) {
  const int order = stages.mesh().order;
  const auto values =
      reference::basis_values(shape, order, reference::NodeSet::Equispaced, 3, face_lattice(shape, intervals));
  std::vector<float> origins, scales;
  std::vector<std::int16_t> steps;
  Eigen::MatrixXd nodes(values.cols(), 3);
  for (const Face& face : faces) {
    const auto& local = reference::facet_nodes(stages.cells().shape(face.cell), order, face.facet);
    for (Eigen::Index i = 0; i < nodes.rows(); ++i) {
      const auto at = stages.point(stage, face.cell, local[static_cast<std::size_t>(i)]);
      for (Eigen::Index d = 0; d < 3; ++d)
        nodes(i, d) = at[static_cast<std::size_t>(d)] - stages.centre()[static_cast<std::size_t>(d)];
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

/// The cells that are there whole, and the Js up to which that is true of every cell, in both stages.
std::vector<std::int32_t> choose_cells(const Stages& stages, double* limit) {
  std::vector<std::int32_t> chosen;
  *limit = 1;
  if (stages.cells().count() <= kAllCells) return stages.worst(0, stages.cells().count());
  std::vector<bool> taken(stages.cells().count());
  for (std::size_t s = 0; s < stages.count(); ++s) {
    const auto worst = stages.worst(s, kWorstCells);
    *limit = std::min(*limit, stages[s].scaled_jacobian[static_cast<std::size_t>(worst.back())]);
    for (const std::int32_t cell : worst) {
      if (!taken[static_cast<std::size_t>(cell)]) chosen.push_back(cell);
      taken[static_cast<std::size_t>(cell)] = true;
    }
  }
  return chosen;
}

}  // namespace

Json pack_cells_3d(const Stages& stages, Packing* packing, std::vector<std::int32_t>* shown) {
  const Cells& cells = stages.cells();
  const Facets sides = facets(stages.mesh());
  double limit = 1;
  const std::vector<std::int32_t> whole = choose_cells(stages, &limit);
  std::vector<std::int32_t> place_of(cells.count(), -1);
  const auto show = [&](std::size_t cell) {
    if (place_of[cell] >= 0) return;
    place_of[cell] = static_cast<std::int32_t>(shown->size());
    shown->push_back(static_cast<std::int32_t>(cell));
  };
  std::vector<Face> skin, inner;
  for (const std::int32_t chosen : whole) {
    const auto c = static_cast<std::size_t>(chosen);
    show(c);
    for (int f = 0; f < static_cast<int>(reference::info(cells.shape(c)).facets.size()); ++f) inner.push_back({c, f});
  }
  for (std::size_t c = 0; c < cells.count(); ++c)
    for (std::int32_t side = sides.first[c]; side < sides.first[c + 1]; ++side)
      if (sides.neighbour[static_cast<std::size_t>(side)] < 0) {
        show(c);
        skin.push_back({c, side - sides.first[c]});
      }

  Json sets = Json::array();
  for (const auto& [set, faces] : {std::pair{"skin", &skin}, std::pair{"inner", &inner}}) {
    const int intervals = intervals_for(faces->size(), stages.mesh().order);
    for (const Shape shape : {Shape::Triangle, Shape::Quadrilateral}) {
      std::vector<Face> of_shape;
      std::vector<std::int32_t> owners;
      for (const Face& face : *faces)
        if (reference::info(cells.shape(face.cell)).facets[static_cast<std::size_t>(face.facet)].shape == shape) {
          of_shape.push_back(face);
          owners.push_back(place_of[face.cell]);
        }
      if (of_shape.empty()) continue;
      const int corners = shape == Shape::Triangle ? 3 : 4;
      const std::string name = std::string(set) + std::to_string(corners);
      // Nodes of the boundary stay where they are.
      const std::size_t kept = std::string_view(set) == "skin" ? 1 : stages.count();
      for (std::size_t s = 0; s < kept; ++s)
        pack_faces(stages, s, of_shape, shape, intervals, name + "_" + Stages::name(s), packing);
      packing->add(name + "_cells", owners);
      sets.push_back({{"name", name}, {"set", set}, {"corners", corners}, {"intervals", intervals}, {"stages", kept}});
    }
  }
  std::vector<float> middles;
  for (const std::int32_t cell : *shown)
    for (std::size_t d = 0; d < 3; ++d)
      middles.push_back(static_cast<float>(stages.middle(0, static_cast<std::size_t>(cell))[d] - stages.centre()[d]));
  packing->add("middles", middles);
  return {{"sets", sets}, {"whole", whole.size()}, {"whole_up_to", limit}};
}

}  // namespace varimesh::client
