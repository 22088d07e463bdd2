#include "core/slide/coupled/boundary_energy.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>

#include "core/base/index.h"

namespace varimesh::detail {
namespace {

Eigen::Map<Eigen::Vector3d> place(std::vector<double>& coordinates, std::int32_t node) {
  return Eigen::Map<Eigen::Vector3d>(&coordinates[3 * at(node)]);
}

/// The vertices of an element, sorted: what elements of a boundary and facets or edges of cells have in common.
using Key = std::array<std::int32_t, 4>;

template <class Nodes>
Key key_of(const Nodes& nodes, int vertices) {
  Key key{-1, -1, -1, -1};
  for (int k = 0; k < vertices; ++k) key[at(k)] = nodes[at(k)];
  std::ranges::sort(key);
  return key;
}

/// Sums of the volumes of the cells at each facet and at each edge that is asked for.
class VolumesAround {
 public:
  void ask(const std::vector<std::vector<EntityElement>>& entities) {
    for (const auto& elements : entities)
      for (const EntityElement& element : elements) sums_[key_of(element.nodes, vertices(element.shape))] = 0;
  }
  void add(const HighOrderMesh& mesh, std::span<const double> volumes) {
    std::size_t cell = 0;
    for (const ElementBlock& block : mesh.blocks) {
      const reference::ShapeInfo& shape = reference::info(block.shape);
      if (shape.dimension != mesh.dimension) continue;
      const auto stride = at(reference::node_count(block.shape, block.order));
      for (std::size_t e = 0; e < block.size(); ++e, ++cell) {
        const std::int32_t* nodes = block.nodes.data() + e * stride;
        for (const reference::Facet& facet : shape.facets) {
          std::array<std::int32_t, 4> own{};
          for (std::size_t k = 0; k < own.size(); ++k) own[k] = facet.vertices[k] < 0 ? -1 : nodes[facet.vertices[k]];
          add(key_of(own, 4), volumes[cell]);
        }
        for (const auto& edge : shape.edges) add(key_of(std::array{nodes[edge[0]], nodes[edge[1]]}, 2), volumes[cell]);
      }
    }
  }
  double of(const EntityElement& element) const { return sums_.at(key_of(element.nodes, vertices(element.shape))); }

 private:
  static int vertices(Shape shape) { return reference::info(shape).vertices; }
  void add(const Key& key, double volume) {
    if (const auto found = sums_.find(key); found != sums_.end()) found->second += volume;
  }
  std::map<Key, double> sums_;
};

}  // namespace

BoundaryEnergy::BoundaryEnergy(const Start& start, const Team& team)
    : association_(start.association),
      order_(start.order),
      curve_elements_(start.curves),
      surface_elements_(start.surfaces),
      team_(team),
      curves_(start.curves.size()),
      surfaces_(start.surfaces.size()),
      owner_(start.coordinates.size() / 3) {
  team.for_each(static_cast<std::int32_t>(curves_.size()), 1, [&](std::int32_t c) {
    const auto& elements = start.curves[at(c)];
    if (elements.empty()) return;
    curves_[at(c)].emplace(association_, c, elements, order_, start.targets);
    curves_[at(c)]->set_nodes(curve_nodes(c, elements, association_, start.coordinates, start.fixed));
  });
  team.for_each(static_cast<std::int32_t>(surfaces_.size()), 1, [&](std::int32_t s) {
    const auto& elements = start.surfaces[at(s)];
    if (elements.empty()) return;
    surfaces_[at(s)].emplace(association_, s, elements, order_, start.targets);
    surfaces_[at(s)]->set_nodes(surface_nodes(s, association_, start.coordinates, start.fixed));
  });
  own(curves_);
  own(surfaces_);
  for (std::int32_t node = 0; node < static_cast<std::int32_t>(owner_.size()); ++node)
    if (slides(node)) sliding_.push_back(node);
}

template <int d>
void BoundaryEnergy::own(const Forms<d>& forms) {
  for (std::size_t entity = 0; entity < forms.size(); ++entity) {
    if (!forms[entity]) continue;
    const std::vector<EntityNode>& nodes = forms[entity]->nodes();
    for (std::size_t i = 0; i < nodes.size(); ++i)
      if (nodes[i].free && !forms[entity]->is_at_pole(i))
        owner_[at(nodes[i].node)] = {d, static_cast<std::int32_t>(entity), static_cast<std::int32_t>(i)};
  }
}

void BoundaryEnergy::prepare(const HighOrderMesh& mesh, std::span<const double> volumes,
                             std::span<const std::int32_t> nodes, double diagonal) {
  diagonal_ = diagonal;
  rank_.assign(owner_.size(), -1);
  for (std::size_t rank = 0; rank < nodes.size(); ++rank) rank_[at(nodes[rank])] = static_cast<std::int32_t>(rank);
  VolumesAround around;
  around.ask(curve_elements_);
  around.ask(surface_elements_);
  around.add(mesh, volumes);
  const auto weigh = [&](const auto& forms, const auto& elements, double factor, auto& weights) {
    weights.resize(forms.size());
    for (std::size_t entity = 0; entity < forms.size(); ++entity)
      for (std::size_t e = 0; e < elements[entity].size(); ++e) {
        const double measure = forms[entity]->measure(e);
        weights[entity].push_back(measure > 0 ? factor * around.of(elements[entity][e]) / measure : 0);
      }
  };
  weigh(curves_, curve_elements_, 1.0 / 12, curve_weights_);
  weigh(surfaces_, surface_elements_, 1.0, surface_weights_);
}

// ===== The energy =====

template <int d>
BoundaryEnergy::Value BoundaryEnergy::sum(const Forms<d>& forms, const std::vector<std::vector<double>>& weights,
                                          double delta) const {
  std::vector<Value> of(forms.size());
  team_.for_each(static_cast<std::int32_t>(forms.size()), 1, [&](std::int32_t i) {
    of[at(i)].least = std::numeric_limits<double>::infinity();
    for (std::size_t e = 0; forms[at(i)] && e < forms[at(i)]->size(); ++e) {
      const auto one = forms[at(i)]->value(e, delta);
      of[at(i)].energy += weights[at(i)][e] * one.energy;
      of[at(i)].least = std::min(of[at(i)].least, one.least);
    }
  });
  Value all{0, std::numeric_limits<double>::infinity()};
  for (const Value& one : of) all = {all.energy + one.energy, std::min(all.least, one.least)};
  return all;
}

BoundaryEnergy::Value BoundaryEnergy::value(double delta, double factor) const {
  const Value curves = sum(curves_, curve_weights_, delta), surfaces = sum(surfaces_, surface_weights_, delta);
  return {factor * (curves.energy + surfaces.energy), std::min(curves.least, surfaces.least)};
}

std::vector<Eigen::Matrix3d> BoundaryEnergy::directions() const {
  std::vector<Eigen::Matrix3d> directions;
  for (std::size_t node = 0; node < rank_.size(); ++node) {
    if (rank_[node] < 0) continue;
    directions.resize(std::max(directions.size(), at(rank_[node]) + 1), Eigen::Matrix3d::Identity());
    const Owner& owner = owner_[node];
    if (owner.dimension == 0) continue;
    Eigen::Matrix3d& T = directions[at(rank_[node])];
    T.setZero();
    if (owner.dimension == 1)
      T.leftCols<1>() = curves_[at(owner.entity)]->tangents(at(owner.place));
    else
      T.leftCols<2>() = surfaces_[at(owner.entity)]->tangents(at(owner.place));
  }
  return directions;
}

template <int d>
void BoundaryEnergy::add(const Forms<d>& forms, const std::vector<std::vector<double>>& weights, double delta,
                         double factor, const std::vector<Eigen::Matrix3d>& directions, std::vector<double>& gradient,
                         std::vector<Eigen::Triplet<double>>& entries) const {
  struct Part {
    std::vector<std::pair<std::int32_t, Eigen::Vector3d>> gradient;
    std::vector<Eigen::Triplet<double>> entries;
  };
  std::vector<Part> parts(forms.size());
  team_.for_each(static_cast<std::int32_t>(forms.size()), 1, [&](std::int32_t i) {
    if (!forms[at(i)]) return;
    const EntityForm<d>& form = *forms[at(i)];
    Part& part = parts[at(i)];
    Eigen::VectorXd slope;
    Eigen::MatrixXd hessian;
    for (std::size_t e = 0; e < form.size(); ++e) {
      const std::vector<std::int32_t>& places = form.places(e);
      const double first = factor * weights[at(i)][e] * diagonal_, second = first * diagonal_;
      form.derivatives(e, delta, slope, hessian);
      for (std::size_t a = 0; a < places.size(); ++a) {
        const std::int32_t row = rank_[at(form.nodes()[at(places[a])].node)];
        if (row < 0) continue;
        part.gradient.emplace_back(row, first * slope.segment<3>(static_cast<Eigen::Index>(3 * a)));
        for (std::size_t b = 0; b < places.size(); ++b) {
          const std::int32_t column = rank_[at(form.nodes()[at(places[b])].node)];
          if (column < 0) continue;
          const Eigen::Matrix3d block =
              second * directions[at(row)].transpose() *
              hessian.block<3, 3>(static_cast<Eigen::Index>(3 * a), static_cast<Eigen::Index>(3 * b)) *
              directions[at(column)];
          for (int r = 0; r < 3; ++r)
            for (int c = 0; c < 3; ++c)
              if (block(r, c) != 0) part.entries.emplace_back(3 * row + r, 3 * column + c, block(r, c));
        }
      }
    }
  });
  for (const Part& part : parts) {
    for (const auto& [rank, slope] : part.gradient)
      for (int k = 0; k < 3; ++k) gradient[3 * at(rank) + at(k)] += slope[k];
    entries.insert(entries.end(), part.entries.begin(), part.entries.end());
  }
}

BoundaryEnergy::Matrix BoundaryEnergy::linearise(double delta, double factor, bool positive,
                                                 const std::vector<Eigen::Matrix3d>& directions,
                                                 std::vector<double>& gradient) const {
  std::vector<Eigen::Triplet<double>> entries;
  add(curves_, curve_weights_, delta, factor, directions, gradient, entries);
  add(surfaces_, surface_weights_, delta, factor, directions, gradient, entries);
  if (!positive) add_curvature(directions, gradient, entries);
  const auto size = static_cast<Eigen::Index>(gradient.size());
  Matrix H(size, size);
  H.setFromTriplets(entries.begin(), entries.end());
  return H;
}

void BoundaryEnergy::add_curvature(const std::vector<Eigen::Matrix3d>& directions, const std::vector<double>& gradient,
                                   std::vector<Eigen::Triplet<double>>& entries) const {
  for (const std::int32_t node : sliding_) {
    const std::int32_t rank = rank_[at(node)];
    if (rank < 0 || directions[at(rank)].isIdentity(0)) continue;
    const Owner& owner = owner_[at(node)];
    // A form by lengths in the mesh's unit is diagonal² of one by relative lengths, and the gradient has one already.
    const Eigen::Vector3d slope = diagonal_ * Eigen::Map<const Eigen::Vector3d>(&gradient[3 * at(rank)]);
    if (owner.dimension == 1) {
      entries.emplace_back(3 * rank, 3 * rank, curves_[at(owner.entity)]->curvature(at(owner.place), slope)(0, 0));
      continue;
    }
    const Eigen::Matrix2d form = surfaces_[at(owner.entity)]->curvature(at(owner.place), slope);
    if (!form.allFinite()) continue;  // the parameters are nearly singular
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 2; ++c) entries.emplace_back(3 * rank + r, 3 * rank + c, form(r, c));
  }
}

// ===== Moves =====

BoundaryEnergy::Places BoundaryEnergy::places() const {
  Places places;
  for (const auto& form : curves_) places.curves.push_back(form ? form->nodes() : std::vector<EntityNode>());
  for (const auto& form : surfaces_) places.surfaces.push_back(form ? form->nodes() : std::vector<EntityNode>());
  return places;
}

void BoundaryEnergy::restore(const Places& places) {
  const auto put = [&](auto& forms, const std::vector<std::vector<EntityNode>>& nodes) {
    team_.for_each(static_cast<std::int32_t>(forms.size()), 1, [&](std::int32_t i) {
      if (!forms[at(i)]) return;
      forms[at(i)]->nodes() = nodes[at(i)];
      forms[at(i)]->take_normals();
    });
  };
  put(curves_, places.curves);
  put(surfaces_, places.surfaces);
}

EntityNode BoundaryEnergy::moved(const Owner& owner, const EntityNode& from, const Eigen::Vector3d& by) const {
  const auto entity = at(owner.entity), place = at(owner.place);
  const double spacing = owner.dimension == 1 ? curves_[entity]->spacing(place) : surfaces_[entity]->spacing(place);
  const double share = std::min(1.0, 0.5 * spacing / by.norm());
  if (!(share > 0)) return from;
  return owner.dimension == 1 ? curves_[entity]->moved(from, place, share * by)
                              : surfaces_[entity]->moved(from, place, share * by);
}

EntityNode BoundaryEnergy::unless_it_leaves(const Owner& owner, const EntityNode& from, const EntityNode& to) const {
  if (owner.dimension == 1) return to;
  const geometry::SurfaceShape& shape = *association_.geometry.surfaces[at(owner.entity)].shape;
  const bool leaves = !shape.contains(to.at[0], to.at[1]) && shape.contains(from.at[0], from.at[1]);
  return leaves ? from : to;
}

void BoundaryEnergy::move(const Places& start, std::span<const double> step, std::vector<double>& coordinates) {
  move_each(
      start,
      [&](const Owner& owner, const EntityNode& from) {
        return moved(owner, from, Eigen::Map<const Eigen::Vector3d>(&step[3 * at(rank_[at(from.node)])]));
      },
      coordinates);
}

void BoundaryEnergy::move_between(const Places& start, const Places& end, double part,
                                  std::vector<double>& coordinates) {
  move_each(
      start,
      [&](const Owner& owner, const EntityNode& from) {
        const auto entity = at(owner.entity), place = at(owner.place);
        const EntityNode& to = (owner.dimension == 1 ? end.curves : end.surfaces)[entity][place];
        const Eigen::Vector3d x = from.x + part * (to.x - from.x);
        return owner.dimension == 1 ? curves_[entity]->put(from, x) : surfaces_[entity]->put(from, x);
      },
      coordinates);
}

template <class To>
void BoundaryEnergy::move_each(const Places& start, const To& to, std::vector<double>& coordinates) {
  team_.for_each(static_cast<std::int32_t>(sliding_.size()), 64, [&](std::int32_t i) {
    const std::int32_t node = sliding_[at(i)];
    if (rank_[at(node)] < 0) return;
    const Owner& owner = owner_[at(node)];
    const EntityNode& from = (owner.dimension == 1 ? start.curves : start.surfaces)[at(owner.entity)][at(owner.place)];
    const EntityNode now = unless_it_leaves(owner, from, to(owner, from));
    (owner.dimension == 1 ? curves_[at(owner.entity)]->nodes()
                          : surfaces_[at(owner.entity)]->nodes())[at(owner.place)] = now;
    place(coordinates, node) = now.x;
  });
  const auto copy = [&](auto& forms) {
    team_.for_each(static_cast<std::int32_t>(forms.size()), 1, [&](std::int32_t i) {
      if (forms[at(i)])
        for (EntityNode& node : forms[at(i)]->nodes()) node.x = place(coordinates, node.node);
    });
  };
  copy(curves_);
  copy(surfaces_);
}

void BoundaryEnergy::follow() {
  team_.for_each(static_cast<std::int32_t>(curves_.size()), 1, [&](std::int32_t c) {
    if (curves_[at(c)]) curves_[at(c)]->take_normals();
  });
  team_.for_each(static_cast<std::int32_t>(surfaces_.size()), 1, [&](std::int32_t s) {
    if (!surfaces_[at(s)]) return;
    for (EntityNode& node : surfaces_[at(s)]->nodes())
      if (owner_[at(node.node)].dimension == 1) node.at = surfaces_[at(s)]->closest(node.x, node.at);
    surfaces_[at(s)]->take_normals();
  });
}

BoundaryEnergy::Distance BoundaryEnergy::distance(const std::vector<double>& coordinates) const {
  std::vector<Distances> on_curves(curves_.size()), on_surfaces(surfaces_.size());
  team_.for_each(static_cast<std::int32_t>(curves_.size()), 1, [&](std::int32_t c) {
    if (curves_[at(c)])
      on_curves[at(c)] = curve_distances(*association_.geometry.curves[at(c)].shape, curve_elements_[at(c)], order_,
                                         curves_[at(c)]->nodes(), coordinates);
  });
  team_.for_each(static_cast<std::int32_t>(surfaces_.size()), 1, [&](std::int32_t s) {
    if (surfaces_[at(s)])
      on_surfaces[at(s)] = surface_distances(*association_.geometry.surfaces[at(s)].shape, surface_elements_[at(s)],
                                             order_, surfaces_[at(s)]->nodes(), coordinates);
  });
  Distance all;
  for (const Distances& one : on_curves) all.curves.add(one);
  for (const Distances& one : on_surfaces) all.surfaces.add(one);
  return all;
}

std::int64_t BoundaryEnergy::folded() const {
  std::int64_t count = 0;
  for (const auto& form : surfaces_) count += form ? form->folded() : 0;
  return count;
}

void BoundaryEnergy::write(Association& association) const {
  for (const std::int32_t node : sliding_) {
    const Owner& owner = owner_[at(node)];
    const auto& nodes =
        owner.dimension == 1 ? curves_[at(owner.entity)]->nodes() : surfaces_[at(owner.entity)]->nodes();
    association.nodes[at(node)].at = nodes[at(owner.place)].at;
    association.nodes[at(node)].distance = 0;
  }
  for (std::size_t s = 0; s < surfaces_.size(); ++s)
    if (surfaces_[s])
      for (const EntityNode& node : surfaces_[s]->nodes()) association.surfaces[s].of(node.node) = node.at;
}

}  // namespace varimesh::detail
