#include "core/slide/distance/boundary_distances.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <numeric>
#include <optional>

#include "core/association/association.h"
#include "core/association/match.h"
#include "core/association/smooth_joints.h"
#include "core/geometry/closest_point.h"
#include "core/slide/between_nodes.h"
#include "core/slide/entity_newton.h"

namespace varimesh {
namespace {

using detail::EntityElement;
using detail::EntityNode;
using detail::number_text;

/// A node that slid is on its surface up to rounding. If the way from its old parameters ends farther away than this,
/// relative to the mesh's size, the whole surface is searched.
constexpr double kOnSurface = 1e-8;
/// Distances below this, relative to the mesh's size, are not worth a sentence.
constexpr double kWorthASentence = 1e-9;
constexpr std::size_t kShown = 3;  ///< Surfaces in a sentence.

std::size_t index(std::int32_t i) { return static_cast<std::size_t>(i); }

/// The elements that were made on one surface of the geometry.
struct Row {
  int surface = 0;  ///< Index in Geometry::surfaces. A surface that was joined to another has the other's.
  SurfaceDistance result;
  std::vector<EntityElement> elements;
  std::vector<std::size_t> places;  ///< Of each element: its place in BoundaryDistances::elements.
};

class Measuring {
 public:
  Measuring(const HighOrderMesh& mesh, const std::vector<double>& after, Association association, double smooth_angle,
            const Team& team)
      : mesh_(mesh), after_(after), association_(std::move(association)), team_(team) {
    const std::vector<std::vector<int>> made_on = association_.surface_of_element;
    if (smooth_angle > 0 && mesh.order > 1) join_smoothly(mesh, association_, smooth_angle * std::numbers::pi / 180);
    collect(made_on);
  }

  BoundaryDistances run() {
    result_.size = association_.size;
    for (auto* distances : {&result_.before, &result_.after}) distances->resize(result_.elements.size());
    measure(mesh_.coordinates, result_.before, &SurfaceDistance::before, &SurfaceDistance::folded_before);
    follow_nodes();
    measure(after_, result_.after, &SurfaceDistance::after, &SurfaceDistance::folded_after);
    sort();
    return std::move(result_);
  }

 private:
  /// @param made_on  by block and element: the surface before any were joined
  void collect(const std::vector<std::vector<int>>& made_on) {
    std::map<int, std::size_t> row_of;
    for (std::size_t b = 0; b < mesh_.blocks.size(); ++b)
      for (std::size_t e = 0; e < made_on[b].size(); ++e) {
        if (made_on[b][e] < 0) continue;
        const auto [at, is_new] = row_of.try_emplace(made_on[b][e], rows_.size());
        if (is_new) rows_.emplace_back();
        Row& row = rows_[at->second];
        const geometry::Surface& surface = association_.geometry.surfaces[index(made_on[b][e])];
        row.surface = association_.surface_of_element[b][e];
        row.result.surface = surface.tag;
        row.result.name = surface.name;
        ++row.result.elements;
        add_element(mesh_.blocks[b], e, at->second);
      }
    for (Row& row : rows_) std::ranges::sort(row.result.tags);
  }

  void add_element(const ElementBlock& block, std::size_t e, std::size_t number) {
    Row& row = rows_[number];
    const auto stride = static_cast<std::ptrdiff_t>(block.nodes.size() / block.size());
    const auto first = block.nodes.begin() + static_cast<std::ptrdiff_t>(e) * stride;
    row.elements.push_back({block.shape, {first, first + stride}, block.entity});
    row.places.push_back(result_.elements.size());
    if (std::ranges::find(row.result.tags, block.entity) == row.result.tags.end())
      row.result.tags.push_back(block.entity);
    result_.elements.push_back(block.numbers[e]);
    result_.surface_of_element.push_back(static_cast<std::int32_t>(number));
  }

  void measure(const std::vector<double>& coordinates, std::vector<float>& distances,
               BoundaryDistance SurfaceDistance::*distance, std::int64_t SurfaceDistance::*folded) {
    const std::vector<bool> none_moves(mesh_.node_count(), true);
    team_.for_each(static_cast<std::int32_t>(rows_.size()), 1, [&](std::int32_t r) {
      Row& row = rows_[index(r)];
      const geometry::SurfaceShape& shape = *association_.geometry.surfaces[index(row.surface)].shape;
      const auto nodes = detail::surface_nodes(row.surface, association_, coordinates, none_moves);
      std::vector<detail::Distances> of(row.elements.size());
      team_.for_each(static_cast<std::int32_t>(of.size()), 1, [&](std::int32_t e) {
        of[index(e)] =
            detail::surface_distances(shape, {&row.elements[index(e)], 1}, mesh_.order, nodes, coordinates, team_);
        distances[row.places[index(e)]] = static_cast<float>(of[index(e)].largest);
      });
      detail::Distances sum;
      for (const detail::Distances& one : of) sum.add(one);
      row.result.*distance = {sum.largest, sum.rms()};
      row.result.*folded = detail::slide_on_surface(row.surface, row.elements, mesh_.order, association_,
                                                    mesh_.coordinates, nodes, 0, team_)
                               .folded_before;
    });
  }

  /// Finds the parameters of the nodes where they are afterwards.
  void follow_nodes() {
    team_.for_each(static_cast<std::int32_t>(association_.surfaces.size()), 1, [&](std::int32_t s) {
      SurfaceNodes& own = association_.surfaces[index(s)];
      const geometry::SurfaceShape& shape = *association_.geometry.surfaces[index(s)].shape;
      std::optional<geometry::SurfaceSearch> search;
      for (std::size_t i = 0; i < own.nodes.size(); ++i) {
        const std::size_t at = 3 * index(own.nodes[i]);
        const Eigen::Map<const Eigen::Vector3d> old(&mesh_.coordinates[at]), now(&after_[at]);
        if (old == now) continue;
        auto& parameters = own.parameters[i];
        geometry::SurfaceFoot foot = geometry::closest_from(shape, now, parameters[0], parameters[1]);
        if (foot.distance > kOnSurface * association_.size) {
          if (!search && shape.pieces() == nullptr) search.emplace(shape);
          const geometry::SurfaceFoot other = search ? search->closest(now) : shape.pieces()->closest(now);
          if (other.distance < foot.distance) foot = other;
        }
        parameters = {foot.u, foot.v};
      }
    });
  }

  void sort() {
    std::vector<std::size_t> order(rows_.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::ranges::sort(order, [&](std::size_t a, std::size_t b) {
      const SurfaceDistance &one = rows_[a].result, &other = rows_[b].result;
      return one.after.largest != other.after.largest ? one.after.largest > other.after.largest
                                                      : one.surface < other.surface;
    });
    std::vector<std::int32_t> place(rows_.size());
    for (const std::size_t row : order) {
      place[row] = static_cast<std::int32_t>(result_.surfaces.size());
      result_.surfaces.push_back(std::move(rows_[row].result));
    }
    for (std::int32_t& surface : result_.surface_of_element) surface = place[index(surface)];
  }

  const HighOrderMesh& mesh_;
  const std::vector<double>& after_;
  Association association_;
  const Team& team_;
  std::vector<Row> rows_;
  BoundaryDistances result_;
};

/// "A, B and C": the texts of the first few, and how many more there are.
std::string list(const std::vector<std::string>& texts) {
  const std::size_t shown = std::min(kShown, texts.size());
  std::string all;
  for (std::size_t i = 0; i < shown; ++i) all += (i == 0 ? "" : i + 1 == texts.size() ? " and " : ", ") + texts[i];
  return all + (texts.size() > shown ? " and " + std::to_string(texts.size() - shown) + " more" : "");
}

}  // namespace

std::string SurfaceDistance::text() const { return geometry::Surface{surface, nullptr, {}, name}.text(); }

std::vector<std::string> BoundaryDistances::sentences() const {
  std::vector<std::string> far, folded, all;
  for (const SurfaceDistance& one : surfaces) {
    if (one.after.largest > kWorthASentence * size && far.size() < kShown)
      far.push_back(one.text() + " (" + number_text(one.after.largest) + ")");
    if (one.folded_after > 0)
      folded.push_back(one.text() + " (" + std::to_string(one.folded_after) + " of " + std::to_string(one.elements) +
                       ")");
  }
  if (!far.empty()) all.push_back("The boundary is farthest from the geometry on " + list(far) + ".");
  if (!folded.empty()) all.push_back("Folded surface elements are left on " + list(folded) + ".");
  return all;
}

void BoundaryDistances::forget_before() {
  before.clear();
  for (SurfaceDistance& one : surfaces) {
    one.before = {};
    one.folded_before = 0;
  }
}

Expected<BoundaryDistances> boundary_distances(const HighOrderMesh& mesh, const std::vector<double>& after,
                                               const geometry::Geometry& geometry, double smooth_angle,
                                               const Team& team) {
  auto association = associate(mesh, geometry, team);
  if (!association) return tl::unexpected(association.error());
  return Measuring(mesh, after, std::move(*association), smooth_angle, team).run();
}

}  // namespace varimesh
