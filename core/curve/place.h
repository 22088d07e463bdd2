// Puts the new nodes of edges and surface elements on the geometry. Internal to core/curve.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "core/curve/between.h"
#include "core/curve/curve.h"
#include "core/curve/layers.h"
#include "core/curve/parts.h"

namespace varimesh::detail {

/// What is placed already in a mesh that was curved before.
struct PlacedBefore {
  std::vector<bool> stays;       ///< By node: whether it stays where it is. Empty: only vertices do.
  std::vector<double> straight;  ///< The coordinates of the mesh with straight sides. Empty: the mesh has them.
};

/// The boundary of a mesh whose new nodes are on straight sides, and where they belong.
class BoundaryPlacing {
 public:
  /// @param mesh         straight-sided; the coordinates of boundary nodes change
  /// @param association  vertices have their entities and parameters; those of new nodes are filled in
  BoundaryPlacing(HighOrderMesh& mesh, Association& association, const MeshParts& parts, const Team& team,
                  PlacedBefore before = {});

  void run();

 private:
  enum class State : std::uint8_t { Inside, Unsure, OnSurface, OnCurve, Placed };

  void find_curves();
  bool stays(std::int32_t node) const { return !stays_.empty() && stays_[static_cast<std::size_t>(node)]; }
  int curve_of(const MeshEdge& edge);
  std::vector<double> ends_on(int curve, std::int32_t node) const;
  std::vector<int> candidates(const MeshEdge& edge) const;
  CurvePiece shortest_piece(int curve, const std::vector<double>& from, const std::vector<double>& to) const;
  void place_on_curve(const MeshEdge& edge, int curve);
  void place_layers();
  void place_on_surface(std::size_t edge);
  void place_inside(const MeshFace& face);
  void place_inside_thin(const EdgeStep& step);

  void put(std::int32_t node, std::int8_t dimension, int entity, const PlacedPoint& point);
  PlacedPoint on_surface(int surface, std::int32_t node);
  Eigen::Map<Eigen::Vector3d> x(std::int32_t node) {
    return Eigen::Map<Eigen::Vector3d>(&mesh_.coordinates[3 * static_cast<std::size_t>(node)]);
  }
  double chord(const MeshEdge& edge) { return (x(edge.ends[0]) - x(edge.ends[1])).norm(); }
  const geometry::SurfaceShape& surface(int s) const {
    return *association_.geometry.surfaces[static_cast<std::size_t>(s)].shape;
  }
  const geometry::SurfaceSearch& search(int s) const { return *surface_searches_[static_cast<std::size_t>(s)]; }

  HighOrderMesh& mesh_;
  Association& association_;
  const MeshParts& parts_;
  const Team& team_;
  const std::vector<bool> stays_;  ///< PlacedBefore::stays.
  const std::vector<double> straight_;
  std::vector<std::unique_ptr<geometry::CurveSearch>> curve_searches_;
  std::vector<std::unique_ptr<geometry::SurfaceSearch>> surface_searches_;
  std::vector<State> states_;    ///< By edge.
  std::vector<int> curves_;      ///< By edge: its curve, or −1.
  std::vector<bool> is_placed_;  ///< By face: whether its inner nodes are placed already.
};

}  // namespace varimesh::detail
