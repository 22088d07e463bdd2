#include "core/association/own_boundary.h"

#include <algorithm>
#include <cmath>

#include "core/association/boundary_parts.h"
#include "core/geometry/pieces.h"
#include "core/mesh/bounding_box.h"

namespace varimesh {
namespace {

using detail::BoundaryChain;
using detail::BoundaryFacet;
using detail::BoundaryParts;

std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }

class Making {
 public:
  Making(const HighOrderMesh& mesh, const BoundaryParts& parts, const Team& team)
      : mesh_(mesh), parts_(parts), team_(team) {}

  OwnBoundary run() {
    set_up();
    make_surfaces();
    make_curves();
    place_corners();
    for (std::size_t node = 0; node < mesh_.node_count(); ++node) {
      if (!parts_.held[node] || now().nodes[node].dimension < 0) continue;
      now().nodes[node] = {};
      now().held.push_back(static_cast<std::int32_t>(node));
    }
    return std::move(result_);
  }

 private:
  Association& now() { return result_.association; }

  void set_up() {
    HighOrderMesh& faces = result_.faces;
    faces.dimension = 2;
    faces.order = mesh_.order;
    faces.coordinates = mesh_.coordinates;
    faces.node_numbers = mesh_.node_numbers;
    faces.periodic = mesh_.periodic;
    faces.node_blocks = {{-1, 0, 0, static_cast<std::int32_t>(mesh_.node_count())}};
    BoundingBox box;
    for (const BoundaryFacet& facet : parts_.facets)
      for (const std::int32_t node : facet.nodes) box.extend(&mesh_.coordinates[3 * index(node)]);
    double square = 0;
    for (std::size_t k = 0; k < 3; ++k) square += std::pow(box.high[k] - box.low[k], 2);
    now().size = std::sqrt(square);
    now().nodes.assign(mesh_.node_count(), {});
  }

  // ===== Surfaces =====

  void make_surfaces() {
    const std::size_t count = parts_.surfaces;
    std::vector<std::vector<std::size_t>> of(count);
    for (std::size_t f = 0; f < parts_.facets.size(); ++f) of[parts_.facets[f].surface].push_back(f);
    now().geometry.surfaces.resize(count);
    now().surfaces.resize(count);
    now().allowed_on_surfaces.resize(count);
    team_.for_each(static_cast<std::int32_t>(count), 1, [&](std::int32_t s) { make_surface(s, of[index(s)]); });
    for (std::size_t s = 0; s < count; ++s) {
      result_.inside += parts_.facets[of[s].front()].is_inside ? 1 : 0;
      add_blocks(static_cast<int>(s), of[s]);
      const SurfaceNodes& own = now().surfaces[s];
      for (std::size_t i = 0; i < own.nodes.size(); ++i)
        now().nodes[index(own.nodes[i])] = {2, static_cast<std::int32_t>(s), 0, own.parameters[i]};
    }
  }

  void make_surface(std::int32_t s, const std::vector<std::size_t>& facets) {
    std::vector<geometry::SurfacePiece> pieces;
    std::vector<std::pair<std::int32_t, std::array<double, 2>>> at;
    for (const std::size_t f : facets) {
      const BoundaryFacet& facet = parts_.facets[f];
      pieces.push_back({facet.shape, parts_.positions(facet.nodes), facet.nodes});
      for (std::size_t k = 0; k < facet.nodes.size(); ++k)
        at.emplace_back(facet.nodes[k], geometry::parameters_of_node(pieces.back(), pieces.size() - 1, mesh_.order, k));
    }
    std::ranges::stable_sort(at, {}, &decltype(at)::value_type::first);
    SurfaceNodes& own = now().surfaces[index(s)];
    for (const auto& [node, parameters] : at) {
      if (!own.nodes.empty() && own.nodes.back() == node) continue;
      own.nodes.push_back(node);
      own.parameters.push_back(parameters);
    }
    const geometry::PieceSurface made = geometry::surface_of_pieces(std::move(pieces), mesh_.order);
    now().geometry.surfaces[index(s)] = {s + 1, made.shape, {}};
    now().allowed_on_surfaces[index(s)] = made.error;
  }

  void add_blocks(int surface, const std::vector<std::size_t>& facets) {
    for (const Shape shape : {Shape::Triangle, Shape::Quadrilateral}) {
      ElementBlock block;
      block.shape = shape;
      block.order = mesh_.order;
      block.entity = surface + 1;
      for (const std::size_t f : facets) {
        const BoundaryFacet& facet = parts_.facets[f];
        if (facet.shape != shape) continue;
        block.numbers.push_back(static_cast<std::int64_t>(f) + 1);
        block.nodes.insert(block.nodes.end(), facet.nodes.begin(), facet.nodes.end());
      }
      if (block.numbers.empty()) continue;
      result_.faces.blocks.push_back(std::move(block));
      now().surface_of_element.emplace_back(result_.faces.blocks.back().size(), surface);
    }
  }

  // ===== Curves and vertices =====

  void make_curves() {
    for (const BoundaryChain& chain : parts_.chains) {
      const auto number = static_cast<int>(now().geometry.curves.size());
      std::vector<Eigen::Matrix3Xd> pieces;
      for (const auto& line : chain.lines) pieces.push_back(parts_.positions(line));
      const geometry::PieceCurve made = geometry::curve_of_pieces(pieces, chain.closed);
      geometry::Curve curve;
      curve.tag = number + 1;
      curve.shape = made.shape;
      curve.surfaces = chain.surfaces;
      if (!chain.closed) curve.vertices = ends(chain);
      for (const int s : chain.surfaces) {
        std::vector<int>& curves = now().geometry.surfaces[index(s)].curves;
        if (curves.empty() || curves.back() != number) curves.push_back(number);
        // Where the curve leaves the surface's border, so do the elements.
        geometry::InterpolationError& allowed = now().allowed_on_surfaces[index(s)];
        allowed = {std::max(allowed.largest, made.error.largest), std::max(allowed.rms, made.error.rms)};
      }
      for (std::size_t k = 0; k < chain.lines.size(); ++k)
        for (std::size_t i = 0; i < chain.lines[k].size(); ++i) {
          // Gmsh's order: both ends, then the nodes between from one end to the other.
          const double part = i < 2 ? static_cast<double>(i) : static_cast<double>(i - 1) / mesh_.order;
          const double t = made.t[k] + part * (made.t[k + 1] - made.t[k]);
          now().nodes[index(chain.lines[k][i])] = {1, number, 0, {t, 0}};
        }
      now().geometry.curves.push_back(std::move(curve));
      now().allowed_on_curves.push_back(made.error);
    }
  }

  std::vector<int> ends(const BoundaryChain& chain) {
    const int first = corner(chain.lines.front()[0]), last = corner(chain.lines.back()[1]);
    return first == last ? std::vector<int>{first} : std::vector<int>{first, last};
  }
  int corner(std::int32_t node) const {
    return static_cast<int>(std::ranges::lower_bound(parts_.corners, node) - parts_.corners.begin());
  }

  void place_corners() {
    for (std::size_t v = 0; v < parts_.corners.size(); ++v) {
      const std::int32_t node = parts_.corners[v];
      now().geometry.vertices.push_back({static_cast<int>(v) + 1, parts_.position(node)});
      now().nodes[index(node)] = {0, static_cast<std::int32_t>(v), 0, {}};
    }
  }

  const HighOrderMesh& mesh_;
  const BoundaryParts& parts_;
  const Team& team_;
  OwnBoundary result_;
};

}  // namespace

std::string OwnBoundary::sentence() const {
  const geometry::Geometry& of = association.geometry;
  return "The boundary of the mesh has " + std::to_string(of.surfaces.size()) + " surfaces, " +
         std::to_string(of.curves.size()) + " curves and " + std::to_string(of.vertices.size()) + " vertices" +
         (inside == 0   ? "."
          : inside == 1 ? "; 1 of the surfaces is an interface inside the mesh."
                        : "; " + std::to_string(inside) + " of the surfaces are interfaces inside the mesh.");
}

Expected<OwnBoundary> own_boundary(const HighOrderMesh& mesh, const Team& team) {
  const BoundaryParts parts(mesh, mesh.order < 2 ? kFlatAngle : kSmoothAngle, team);
  if (parts.facets.empty()) return bad_input("The mesh has no boundary on which nodes could slide.");
  return Making(mesh, parts, team).run();
}

}  // namespace varimesh
