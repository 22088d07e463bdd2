// Chooses edges and faces, straightens them, carries their neighbours along, and gives up those that cost a
// certificate.
#include "core/repair/straighten.h"

#include <algorithm>
#include <array>
#include <set>
#include <string>

#include "core/base/index.h"
#include "core/diagnosis/elements_text.h"
#include "core/diagnosis/node_positions.h"
#include "core/mesh/changes/simplex_blend.h"
#include "core/mesh/connectivity.h"
#include "core/validity/certifier.h"

namespace varimesh {
namespace {

using detail::SimplexBlend;
/// An edge, face or cell by its vertices in ascending order, filled up with −1.
using Part = std::array<std::int32_t, 4>;

class Straightener {
 public:
  Straightener(HighOrderMesh& mesh, const std::vector<bool>& fixed, const Certifier& certifier,
               std::vector<Certificate>& certificates, const Team& team)
      : mesh_(mesh),
        fixed_(fixed),
        certifier_(certifier),
        certificates_(certificates),
        team_(team),
        cells_(mesh, mesh.dimension),
        facets_(facets(mesh)) {}

  std::vector<RepairStep> straighten(std::span<const UnrepairableGroup> groups) {
    std::vector<std::vector<std::int32_t>> wanted;
    for (const UnrepairableGroup& group : groups) {
      wanted.push_back(neighbourhood(group));
      for (const std::int32_t cell : wanted.back()) add_parts(cell);
    }
    if (!parts_.empty()) straighten_parts();
    std::vector<RepairStep> steps;
    for (std::size_t g = 0; g < groups.size(); ++g)
      if (!wanted[g].empty()) say(groups[g], wanted[g], steps);
    say_what_is_not_offered(groups, steps);
    return steps;
  }

 private:
  bool is_simplex(std::int32_t cell) const {
    const Shape shape = cells_.shape(at(cell));
    return shape == Shape::Triangle || shape == Shape::Tetrahedron;
  }

  /// The simplices among the group's uncertified cells and the cells that share a facet with one.
  std::vector<std::int32_t> neighbourhood(const UnrepairableGroup& group) const {
    std::vector<std::int32_t> result;
    for (const std::int32_t cell : group.cells) {
      if (certificates_[at(cell)].is_valid()) continue;
      result.push_back(cell);
      for (std::int32_t f = facets_.first[at(cell)]; f < facets_.first[at(cell) + 1]; ++f)
        if (facets_.neighbour[at(f)] >= 0) result.push_back(facets_.neighbour[at(f)]);
    }
    std::erase_if(result, [&](std::int32_t cell) { return !is_simplex(cell); });
    std::ranges::sort(result);
    result.erase(std::unique(result.begin(), result.end()), result.end());
    return result;
  }

  const SimplexBlend& blend_of(std::int32_t cell) const {
    return detail::simplex_blend(cells_.shape(at(cell)), mesh_.order);
  }

  template <class Vertices>
  Part part(std::int32_t cell, const Vertices& vertices) const {
    Part result{-1, -1, -1, -1};
    std::size_t count = 0;
    for (const auto v : vertices)
      if (v >= 0) result[count++] = cells_.nodes(at(cell))[at(v)];
    std::sort(result.begin(), result.begin() + static_cast<std::ptrdiff_t>(count));
    return result;
  }
  Part whole(std::int32_t cell) const {
    Part result{-1, -1, -1, -1};
    const auto vertices = at(reference::info(cells_.shape(at(cell))).vertices);
    std::copy_n(cells_.nodes(at(cell)).begin(), vertices, result.begin());
    std::sort(result.begin(), result.begin() + static_cast<std::ptrdiff_t>(vertices));
    return result;
  }

  /// Calls visit(part, its inner nodes, how they follow the part's boundary) for the edges, the faces and the inside of
  /// a simplex, in this order.
  template <class Visit>
  void for_each_part(std::int32_t cell, Visit&& visit) const {
    const auto& info = reference::info(cells_.shape(at(cell)));
    const SimplexBlend& table = blend_of(cell);
    const Eigen::MatrixXd none;
    for (std::size_t e = 0; e < info.edges.size(); ++e) visit(part(cell, info.edges[e]), table.edges[e], none);
    for (std::size_t f = 0; f < info.faces.size(); ++f)
      visit(part(cell, info.faces[f].vertices), table.faces[f], table.on_face[f]);
    visit(whole(cell), table.inside, table.in_cell);
  }

  bool is_free(std::int32_t cell, const std::vector<int>& local) const {
    return std::ranges::none_of(local, [&](int n) { return fixed_[at(cells_.nodes(at(cell))[at(n)])]; });
  }

  void add_parts(std::int32_t cell) {
    for_each_part(cell, [&](const Part& part, const std::vector<int>& local, const Eigen::MatrixXd&) {
      if (!local.empty() && is_free(cell, local)) parts_.insert(part);
    });
  }

  /// How far the cell's nodes at these coordinates deviate from their straight-sided places: nodes × 3.
  Eigen::MatrixXd deviation(std::int32_t cell, const std::vector<double>& coordinates) const {
    const Eigen::MatrixXd x = detail::node_positions(coordinates, cells_.nodes(at(cell)));
    const Eigen::MatrixXd& linear = blend_of(cell).linear;
    return x - linear * x.topRows(linear.cols());
  }

  /// The coordinates with all chosen parts straight. `cells` are the simplices that have a vertex of one.
  std::vector<double> straight(const std::vector<std::int32_t>& cells) const {
    std::vector<double> result = mesh_.coordinates;
    std::vector<char> done(mesh_.node_count(), 0);
    // Edges first, then faces, then cells: the boundary of a part is in place before the part itself.
    for (int dimension = 1; dimension <= mesh_.dimension; ++dimension)
      for (const std::int32_t cell : cells) place_parts(cell, dimension, done, result);
    return result;
  }

  void place_parts(std::int32_t cell, int dimension, std::vector<char>& done, std::vector<double>& result) const {
    const auto nodes = cells_.nodes(at(cell));
    const Eigen::MatrixXd before = deviation(cell, mesh_.coordinates), after = deviation(cell, result);
    for_each_part(cell, [&](const Part& part, const std::vector<int>& local, const Eigen::MatrixXd& follow) {
      const auto vertices = std::ranges::count_if(part, [](std::int32_t v) { return v >= 0; });
      if (vertices != dimension + 1 || local.empty() || done[at(nodes[at(local[0])])] || !is_free(cell, local)) return;
      const bool chosen = parts_.contains(part);
      Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(local.size()), 3);
      if (chosen) moved = -before(local, Eigen::all);
      if (follow.size() > 0 && chosen) moved += follow * after;
      if (follow.size() > 0 && !chosen) moved += follow * (after - before);
      if (!chosen && (follow.size() == 0 || after == before)) return;
      for (std::size_t n = 0; n < local.size(); ++n) {
        const std::size_t node = at(nodes[at(local[n])]);
        done[node] = 1;
        for (std::size_t c = 0; c < 3; ++c)
          result[3 * node + c] = mesh_.coordinates[3 * node + c] + moved(static_cast<Eigen::Index>(n), at(c));
      }
    });
  }

  /// Straightens the chosen parts; gives up those of cells that would lose their certificate, and tries the others
  /// again.
  void straighten_parts() {
    std::vector<double> moved;
    for (;;) {
      team_.look();
      std::vector<char> touched(mesh_.node_count(), 0);
      for (const Part& part : parts_)
        for (const std::int32_t vertex : part)
          if (vertex >= 0) touched[at(vertex)] = 1;
      std::vector<std::int32_t> all, simplices;
      for (std::size_t c = 0; c < cells_.count(); ++c) {
        const auto cell = static_cast<std::int32_t>(c);
        if (std::ranges::none_of(cells_.nodes(c).first(at(reference::info(cells_.shape(c)).vertices)),
                                 [&](std::int32_t node) { return touched[at(node)] != 0; }))
          continue;
        all.push_back(cell);
        if (is_simplex(cell)) simplices.push_back(cell);
      }
      moved = straight(simplices);
      std::vector<Certificate> now = certificates_;
      certifier_.certify(moved, all, now, team_);
      bool lost = false;
      for (const std::int32_t cell : all)
        if (certificates_[at(cell)].is_valid() && !now[at(cell)].is_valid()) lost = give_up(cell) || lost;
      if (lost) continue;
      mesh_.coordinates = std::move(moved);
      certificates_ = std::move(now);
      return;
    }
  }

  /// Drops the cell's parts from those to straighten. If it has none, or is not a simplex, drops all parts that share a
  /// vertex with it. True if there were any.
  bool give_up(std::int32_t cell) {
    std::size_t erased = 0;
    if (is_simplex(cell))
      for_each_part(cell, [&](const Part& part, const std::vector<int>&, const Eigen::MatrixXd&) {
        erased += parts_.erase(part);
      });
    if (erased > 0) return true;
    const auto vertices = cells_.nodes(at(cell)).first(at(reference::info(cells_.shape(at(cell))).vertices));
    return std::erase_if(parts_, [&](const Part& part) {
             return std::ranges::any_of(
                 part, [&](std::int32_t v) { return v >= 0 && std::ranges::find(vertices, v) != vertices.end(); });
           }) > 0;
  }

  bool is_straight(std::int32_t cell) const {
    bool straight = true;
    for_each_part(cell, [&](const Part& part, const std::vector<int>& local, const Eigen::MatrixXd&) {
      straight = straight && (local.empty() || !is_free(cell, local) || parts_.contains(part));
    });
    return straight;
  }

  void say(const UnrepairableGroup& group, const std::vector<std::int32_t>& wanted,
           std::vector<RepairStep>& steps) const {
    RepairStep done, left;
    for (const std::int32_t cell : wanted)
      (is_straight(cell) ? done : left).elements.push_back(cells_.number(at(cell)));
    const std::string where = group.vertex != 0 ? " at node " + std::to_string(group.vertex)
                                                : " around element " + std::to_string(group.elements.front());
    if (!done.elements.empty()) {
      done.kind = RepairStep::Kind::Straightened;
      done.sentence = "Made straight-sided except on the boundary" + where + ": " +
                      elements_text(done.elements, "element", "elements") + ".";
      steps.push_back(std::move(done));
    }
    if (!left.elements.empty()) {
      left.sentence = "Left curved" + where + ", because straight sides would make a neighbour invalid: " +
                      elements_text(left.elements, "element", "elements") + ".";
      steps.push_back(std::move(left));
    }
  }

  void say_what_is_not_offered(std::span<const UnrepairableGroup> groups, std::vector<RepairStep>& steps) const {
    std::set<std::int64_t> others;
    for (const UnrepairableGroup& group : groups)
      for (const std::int32_t cell : group.cells)
        if (!is_simplex(cell) && !certificates_[at(cell)].is_valid()) others.insert(cells_.number(at(cell)));
    if (others.empty()) return;
    RepairStep step;
    step.elements.assign(others.begin(), others.end());
    step.sentence = "Only triangles and tetrahedra can be made straight-sided: " +
                    elements_text(step.elements, "element", "elements") + " stay as the optimisation left them.";
    steps.push_back(std::move(step));
  }

  HighOrderMesh& mesh_;
  const std::vector<bool>& fixed_;
  const Certifier& certifier_;
  std::vector<Certificate>& certificates_;
  const Team& team_;
  Cells cells_;
  Facets facets_;
  std::set<Part> parts_;  // those to straighten
};

}  // namespace

std::vector<RepairStep> straighten(HighOrderMesh& mesh, const std::vector<bool>& fixed, const Certifier& certifier,
                                   std::vector<Certificate>& certificates, std::span<const UnrepairableGroup> groups,
                                   const Team& team) {
  return Straightener(mesh, fixed, certifier, certificates, team).straighten(groups);
}

}  // namespace varimesh
