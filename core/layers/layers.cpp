#include "core/layers/layers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include "core/base/index.h"
#include "core/layers/columns.h"
#include "core/layers/flat_sides.h"
#include "core/layers/placement.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

using detail::LayerCell;

/// How far the nodes of a cell are from parallel surfaces.
struct Distance {
  double across = 0;  ///< Along the wall's normal, relative to the height of the cell.
  double along = 0;   ///< Along the wall, relative to its width.

  bool within(const Distance& most) const { return across <= most.across && along <= most.along; }
};

/// The nodes of a cell that are this near to parallel surfaces stay there. On a quarter annulus the distance is 1e-6 if
/// the nodes lie on circles, and .03 after the elements were made as straight as they go. Along the wall less depends
/// on a node's place, and the wall's normal is known less well.
constexpr Distance kKept{.across = 0.02, .along = 0.1};
/// The same for nodes of a valid mesh that only change their spacing. Round the nose of an ellipse, where normals of
/// quadratic walls are far off, nodes on exactly parallel surfaces are .03 away. Along the wall five times as much is
/// near, as in kKept.
constexpr Distance kSlides{.across = 0.05, .along = 0.25};
/// The same if nodes are placed.
constexpr Distance kPlaced{.across = 1e-3, .along = 1e-3};
/// Cells that are higher than this, relative to their width, do not get nodes on parallel surfaces: if the spacing is
/// kept, and if it changes. Round an ellipse of quintic triangles with heights graded 1:1000, 1.5 leaves 2.7 times the
/// error of parallel surfaces for exp(−n/.3), 2 leaves 1.3 times, and 2.5 or more 1.0 times; a wave's
/// error is .22, .41 and .42 of that on parallel surfaces. With cubic triangles and 1:100,000, 2.5 leaves 1.3 times,
/// and 4 or more 1.0 times.
constexpr double kHighestKept = 4, kHighestSpaced = 2;

/// How far two nodes are from each other. `normal`: of the wall.
Distance distance(const double* from, const double* to, const double* normal, const LayerCell& cell) {
  const std::array<double, 3> way{to[0] - from[0], to[1] - from[1], to[2] - from[2]};
  const double across = std::inner_product(way.begin(), way.end(), normal, 0.0);
  const double whole = std::hypot(way[0], way[1], way[2]);
  return {std::abs(across) / cell.height, std::sqrt(std::max(0.0, whole * whole - across * across)) / cell.width};
}

/// Nodes that lie near parallel surfaces are to move by the change of their spacing, and not to parallel surfaces that
/// are found anew: the surfaces of the mesh are at least as exact. Nodes of other cells are to go where `changed` has
/// them.
///
/// @param kept, changed  where nodes lie on parallel surfaces with the spacing as it came, and with another one
void keep_near_surfaces(const HighOrderMesh& mesh, std::span<const Certificate> before, const detail::Placement& kept,
                        detail::Placement& changed) {
  const Cells cells(mesh, mesh.dimension);
  const Distance most = are_valid(before) ? kSlides : kKept;
  std::vector<char> is_far(kept.nodes.size(), 0);
  const auto place_of = [&](std::int32_t node) {
    return at(std::ranges::lower_bound(kept.nodes, node) - kept.nodes.begin());
  };
  std::vector<std::size_t> places;
  for (const LayerCell& cell : kept.cells) {
    places.clear();
    for (const std::int32_t node : cells.nodes(at(cell.cell)))
      if (const std::size_t k = place_of(node); k < kept.nodes.size() && kept.nodes[k] == node) places.push_back(k);
    const bool is_near = before[at(cell.cell)].is_valid() && std::ranges::all_of(places, [&](std::size_t k) {
                           return distance(&mesh.coordinates[3 * at(kept.nodes[k])], &kept.coordinates[3 * k],
                                           &kept.normals[3 * k], cell)
                               .within(most);
                         });
    if (is_near) continue;
    for (const std::size_t k : places) is_far[k] = 1;
  }
  for (std::size_t k = 0; k < is_far.size(); ++k)
    for (std::size_t c = 0; c < 3 && is_far[k] == 0; ++c)
      changed.coordinates[3 * k + c] += mesh.coordinates[3 * at(kept.nodes[k]) + c] - kept.coordinates[3 * k + c];
}

class Start {
 public:
  Start(const HighOrderMesh& mesh, const std::vector<bool>& fixed, const detail::FlatSides& sides, LayerSpacing spacing,
        const Certifier& certifier, std::span<const Certificate> before, detail::Placement placement, const Team& team)
      : mesh_(mesh),
        fixed_(fixed),
        sides_(sides),
        changes_spacing_(spacing != LayerSpacing::Keep),
        highest_(changes_spacing_ ? kHighestSpaced : kHighestKept),
        certifier_(certifier),
        before_(before),
        placement_(std::move(placement)),
        team_(team),
        cells_(mesh, mesh.dimension),
        coordinates_(mesh.coordinates),
        after_(before.begin(), before.end()) {}

  LayerStart run() {
    choose();
    place();
    note_touched_cells();
    for (std::vector<std::int32_t> suspects = touched_; !suspects.empty();) suspects = take_back(suspects);
    return outcome();
  }

 private:
  enum class Kind : char { Left, Even, Placed };

  std::span<const std::int32_t> nodes(const LayerCell& cell) const { return cells_.nodes(at(cell.cell)); }

  /// Where a node would be; null: it is on the wall.
  const double* wanted(std::int32_t node) const {
    const auto found = std::ranges::lower_bound(placement_.nodes, node);
    if (found == placement_.nodes.end() || *found != node) return nullptr;
    return &placement_.coordinates[3 * at(found - placement_.nodes.begin())];
  }

  /// How far a node is from where it would be.
  Distance distance(const LayerCell& cell, std::int32_t node) const {
    const double* to = wanted(node);
    if (to == nullptr) return {};
    const double* normal = &placement_.normals[at(to - placement_.coordinates.data())];
    return varimesh::distance(&mesh_.coordinates[3 * at(node)], to, normal, cell);
  }

  bool is_even(const LayerCell& cell, const Distance& most) const {
    return std::ranges::all_of(nodes(cell), [&](std::int32_t node) { return distance(cell, node).within(most); });
  }

  void choose() {
    const bool may_move = changes_spacing_ || !are_valid(before_);
    for (const LayerCell& cell : placement_.cells) {
      const bool is_valid = before_[at(cell.cell)].is_valid();
      const bool moves = may_move && (cell.height < highest_ * cell.width || !is_valid);
      if (is_valid && is_even(cell, may_move ? kPlaced : kKept))
        kinds_.push_back(Kind::Even);
      else
        kinds_.push_back(moves ? Kind::Placed : Kind::Left);
    }
  }

  void place() {
    std::vector<char> moves(mesh_.node_count(), 0);
    for (std::size_t i = 0; i < kinds_.size(); ++i)
      if (kinds_[i] == Kind::Placed)
        for (const std::int32_t node : nodes(placement_.cells[i]))
          moves[at(node)] = fixed_[at(node)] && !sides_.has(node) ? 0 : 1;
    for (std::size_t i = 0; i < kinds_.size(); ++i)
      if (kinds_[i] == Kind::Even)
        for (const std::int32_t node : nodes(placement_.cells[i])) moves[at(node)] = 0;
    for (const std::int32_t node : placement_.nodes)
      if (moves[at(node)] != 0) std::copy_n(wanted(node), 3, &coordinates_[3 * at(node)]);
    for (std::size_t cell = 0; cell < cells_.count(); ++cell)
      if (std::ranges::any_of(cells_.nodes(cell), [&](std::int32_t node) { return moves[at(node)] != 0; }))
        touched_.push_back(static_cast<std::int32_t>(cell));
    certifier_.certify(coordinates_, touched_, after_, team_);
  }

  /// Cells that lost their certificate, and placed cells that are not valid, get their nodes back. `suspects`: cells
  /// whose nodes have moved since they were looked at. Returns the cells of the nodes that moved back.
  std::vector<std::int32_t> take_back(const std::vector<std::int32_t>& suspects) {
    std::vector<std::int32_t> again;
    for (const std::int32_t cell : suspects) {
      if (after_[at(cell)].is_valid()) continue;
      bool takes = before_[at(cell)].is_valid();
      if (const std::int32_t i = in_placement_[at(cell)]; i >= 0 && kinds_[at(i)] == Kind::Placed) {
        kinds_[at(i)] = Kind::Left;
        takes = true;
      }
      if (!takes) continue;
      for (const std::int32_t node : cells_.nodes(at(cell))) {
        const std::size_t k = 3 * at(node);
        if (std::equal(&coordinates_[k], &coordinates_[k] + 3, &mesh_.coordinates[k])) continue;
        std::copy_n(&mesh_.coordinates[k], 3, &coordinates_[k]);
        again.insert(again.end(), touched_at_.begin() + first_touched_[at(node)],
                     touched_at_.begin() + first_touched_[at(node) + 1]);
      }
    }
    std::ranges::sort(again);
    again.erase(std::ranges::unique(again).begin(), again.end());
    if (!again.empty()) certifier_.certify(coordinates_, again, after_, team_);
    return again;
  }

  /// Lists the touched cells by their nodes, and where cells are in the placement.
  void note_touched_cells() {
    first_touched_.assign(mesh_.node_count() + 1, 0);
    for (const std::int32_t cell : touched_)
      for (const std::int32_t node : cells_.nodes(at(cell))) ++first_touched_[at(node) + 1];
    std::partial_sum(first_touched_.begin(), first_touched_.end(), first_touched_.begin());
    touched_at_.resize(at(first_touched_.back()));
    std::vector<std::int32_t> next(first_touched_.begin(), first_touched_.end() - 1);
    for (const std::int32_t cell : touched_)
      for (const std::int32_t node : cells_.nodes(at(cell))) touched_at_[at(next[at(node)]++)] = cell;
    in_placement_.assign(cells_.count(), -1);
    for (std::size_t i = 0; i < kinds_.size(); ++i)
      in_placement_[at(placement_.cells[i].cell)] = static_cast<std::int32_t>(i);
  }

  LayerStart outcome() {
    LayerStart start;
    start.held.assign(mesh_.node_count(), 0);
    start.cells = static_cast<std::int64_t>(placement_.cells.size());
    for (std::size_t i = 0; i < kinds_.size(); ++i) {
      start.placed += kinds_[i] == Kind::Placed ? 1 : 0;
      if (kinds_[i] != Kind::Left)
        for (const std::int32_t node : nodes(placement_.cells[i])) start.held[at(node)] = 1;
    }
    for (const std::int32_t cell : touched_)
      start.made_valid += !before_[at(cell)].is_valid() && after_[at(cell)].is_valid() ? 1 : 0;
    const bool is_placed = start.made_valid > 0 || (changes_spacing_ && start.placed > 0);
    if (!is_placed) start.placed = 0;
    if (is_placed) start.coordinates = std::move(coordinates_);
    // What is still to be repaired may need any node: on a sphere with one layer of prisms, 19 cells stayed invalid
    // beside held nodes. Placed nodes are worth it only if they certify a cell.
    if (!are_valid(is_placed ? std::span<const Certificate>(after_) : before_)) start.held.clear();
    bool holds = false;
    for (std::size_t node = 0; node < start.held.size(); ++node)
      holds = holds || (start.held[node] != 0 && !fixed_[node]);
    if (!holds) start.held.clear();
    return start;
  }

  const HighOrderMesh& mesh_;
  const std::vector<bool>& fixed_;
  const detail::FlatSides& sides_;
  const bool changes_spacing_;
  const double highest_;  ///< How high a low cell is at most, relative to its width.
  const Certifier& certifier_;
  const std::span<const Certificate> before_;
  const detail::Placement placement_;
  const Team& team_;
  const Cells cells_;
  std::vector<double> coordinates_;
  std::vector<Certificate> after_;
  std::vector<Kind> kinds_;                               ///< By cell of the placement.
  std::vector<std::int32_t> touched_;                     ///< Cells with a node that may have moved.
  std::vector<std::int32_t> first_touched_, touched_at_;  ///< By node: those of them that have it.
  std::vector<std::int32_t> in_placement_;                ///< By cell: where it is in the placement; −1: nowhere.
};

}  // namespace

LayerStart start_layers(const HighOrderMesh& mesh, const Facets& facets, const std::vector<bool>& fixed,
                        LayerSpacing spacing, OnFlatSides on_flat_sides, const Team& team) {
  using detail::Walls;
  const detail::Columns columns =
      detail::find_columns(mesh, facets, spacing == LayerSpacing::Keep ? Walls::Curved : Walls::All);
  if (columns.empty()) return {};
  const bool slides = spacing != LayerSpacing::Keep && on_flat_sides == OnFlatSides::Slide;
  const detail::FlatSides sides = slides ? detail::FlatSides(mesh, facets, columns) : detail::FlatSides();
  detail::Placement placement = detail::place_in_layers(mesh, columns, spacing, fixed, sides);
  if (placement.cells.empty()) return {};
  const Certifier certifier(mesh, {}, team);
  std::vector<Certificate> certificates(certifier.cells());
  certifier.certify(mesh.coordinates, certificates, team);
  if (spacing != LayerSpacing::Keep)
    keep_near_surfaces(mesh, certificates, detail::place_in_layers(mesh, columns, LayerSpacing::Keep, fixed, sides),
                       placement);
  return Start(mesh, fixed, sides, spacing, certifier, certificates, std::move(placement), team).run();
}

}  // namespace varimesh
