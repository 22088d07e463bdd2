#include "core/slide/coupled/boundary_energy.h"

#include <algorithm>
#include <limits>

#include "core/base/index.h"
#include "core/slide/coupled/volumes_around.h"

namespace varimesh::detail {
namespace {

Eigen::Map<Eigen::Vector3d> place(std::vector<double>& coordinates, std::int32_t node) {
  return Eigen::Map<Eigen::Vector3d>(&coordinates[3 * at(node)]);
}

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
  prepare_hessian();
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

// ===== Its derivatives =====

template <int d, class Visit>
void BoundaryEnergy::for_pairs(const EntityForm<d>& form, std::size_t element, const Visit& visit) const {
  const std::vector<std::int32_t>& places = form.places(element);
  const auto rank = [&](std::size_t k) { return rank_[at(form.nodes()[at(places[k])].node)]; };
  for (std::size_t a = 0; a < places.size(); ++a) {
    const std::int32_t row = rank(a);
    if (row < 0) continue;
    for (std::size_t b = 0; b < places.size(); ++b)
      if (const std::int32_t column = rank(b); column >= 0) visit(a, b, row, column);
  }
}

void BoundaryEnergy::prepare_hessian() {
  std::int32_t ranks = 0;
  for (const std::int32_t rank : rank_) ranks = std::max(ranks, rank + 1);
  std::vector<std::int8_t> directions(at(ranks), 3);
  for (std::size_t node = 0; node < rank_.size(); ++node)
    if (rank_[node] >= 0 && owner_[node].dimension > 0) directions[at(rank_[node])] = owner_[node].dimension;
  hessian_ = BoundaryHessian(std::move(directions));
  const auto visit_all = [&](const auto& forms, const auto& visit) {
    for (std::size_t entity = 0; entity < forms.size(); ++entity)
      for (std::size_t e = 0; forms[entity] && e < forms[entity]->size(); ++e)
        for_pairs(*forms[entity], e,
                  [&](std::size_t, std::size_t, std::int32_t row, std::int32_t column) { visit(entity, row, column); });
  };
  const auto has = [&](std::size_t, std::int32_t row, std::int32_t column) { hessian_.has(row, column); };
  visit_all(curves_, has);
  visit_all(surfaces_, has);
  for (const std::int32_t node : sliding_)
    if (const std::int32_t rank = rank_[at(node)]; rank >= 0) hessian_.has(rank, rank);
  hessian_.finish();
  const auto find = [&](const auto& forms, BlockPlaces& blocks) {
    blocks.assign(forms.size(), {});
    visit_all(forms, [&](std::size_t entity, std::int32_t row, std::int32_t column) {
      blocks[entity].push_back(hessian_.place(row, column));
    });
  };
  find(curves_, curve_blocks_);
  find(surfaces_, surface_blocks_);
  own_blocks_.clear();
  for (const std::int32_t node : sliding_)
    if (const std::int32_t rank = rank_[at(node)]; rank >= 0) own_blocks_.push_back(hessian_.place(rank, rank));
}

// The blocks of nodes that belong to an entity come from its elements only, so the threads add them at once. The others
// are added afterwards, in the order of the entities.
template <int d>
void BoundaryEnergy::add(const Forms<d>& forms, const std::vector<std::vector<double>>& weights,
                         const BlockPlaces& blocks, double delta, double factor,
                         const std::vector<Eigen::Matrix3d>& directions, std::vector<double>& gradient) {
  struct Shared {
    std::int32_t row, column;
    BoundaryHessian::Place place;
    Eigen::Matrix3d block;
  };
  struct Part {
    std::vector<std::pair<std::int32_t, Eigen::Vector3d>> gradient;
    std::vector<Shared> shared;
  };
  std::vector<Part> parts(forms.size());
  team_.for_each(static_cast<std::int32_t>(forms.size()), 1, [&](std::int32_t i) {
    if (!forms[at(i)]) return;
    const EntityForm<d>& form = *forms[at(i)];
    Part& part = parts[at(i)];
    auto place = blocks[at(i)].begin();
    Eigen::VectorXd slope;
    Eigen::MatrixXd hessian;
    std::vector<char> is_own;  // by node of the element
    for (std::size_t e = 0; e < form.size(); ++e) {
      const std::vector<std::int32_t>& places = form.places(e);
      const double first = factor * weights[at(i)][e] * diagonal_, second = first * diagonal_;
      form.derivatives(e, delta, slope, hessian);
      is_own.resize(places.size());
      for (std::size_t a = 0; a < places.size(); ++a) {
        const std::int32_t node = form.nodes()[at(places[a])].node;
        is_own[a] = owner_[at(node)].dimension == d && owner_[at(node)].entity == i ? 1 : 0;
        if (const std::int32_t row = rank_[at(node)]; row >= 0)
          part.gradient.emplace_back(row, first * slope.segment<3>(static_cast<Eigen::Index>(3 * a)));
      }
      for_pairs(form, e, [&](std::size_t a, std::size_t b, std::int32_t row, std::int32_t column) {
        const Eigen::Matrix3d block =
            second * directions[at(row)].transpose() *
            hessian.block<3, 3>(static_cast<Eigen::Index>(3 * a), static_cast<Eigen::Index>(3 * b)) *
            directions[at(column)];
        if (is_own[a] != 0 && is_own[b] != 0)
          hessian_.add(row, column, *place, block);
        else
          part.shared.push_back({row, column, *place, block});
        ++place;
      });
    }
  });
  for (const Part& part : parts) {
    for (const auto& [rank, slope] : part.gradient)
      for (int k = 0; k < 3; ++k) gradient[3 * at(rank) + at(k)] += slope[k];
    for (const Shared& one : part.shared) hessian_.add(one.row, one.column, one.place, one.block);
  }
}

const BoundaryEnergy::Matrix& BoundaryEnergy::linearise(double delta, double factor, bool positive,
                                                        const std::vector<Eigen::Matrix3d>& directions,
                                                        std::vector<double>& gradient) {
  hessian_.set_zero();
  add(curves_, curve_weights_, curve_blocks_, delta, factor, directions, gradient);
  add(surfaces_, surface_weights_, surface_blocks_, delta, factor, directions, gradient);
  if (!positive) add_curvature(directions, gradient);
  return hessian_.matrix();
}

void BoundaryEnergy::add_curvature(const std::vector<Eigen::Matrix3d>& directions,
                                   const std::vector<double>& gradient) {
  auto place = own_blocks_.begin();
  for (const std::int32_t node : sliding_) {
    const std::int32_t rank = rank_[at(node)];
    if (rank < 0) continue;
    const BoundaryHessian::Place own = *place++;
    if (directions[at(rank)].isIdentity(0)) continue;
    const Owner& owner = owner_[at(node)];
    // A form by lengths in the mesh's unit is diagonal² of one by relative lengths, and the gradient has one already.
    const Eigen::Vector3d slope = diagonal_ * Eigen::Map<const Eigen::Vector3d>(&gradient[3 * at(rank)]);
    Eigen::Matrix3d block = Eigen::Matrix3d::Zero();
    if (owner.dimension == 1)
      block(0, 0) = curves_[at(owner.entity)]->curvature(at(owner.place), slope)(0, 0);
    else
      block.topLeftCorner<2, 2>() = surfaces_[at(owner.entity)]->curvature(at(owner.place), slope);
    if (!block.allFinite()) continue;  // the parameters are nearly singular
    hessian_.add(rank, rank, own, block);
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

void BoundaryEnergy::move_between(const Places& start, const Places& end, std::span<const double> parts,
                                  std::vector<double>& coordinates) {
  move_each(
      start,
      [&](const Owner& owner, const EntityNode& from) {
        const auto entity = at(owner.entity), place = at(owner.place);
        const EntityNode& to = (owner.dimension == 1 ? end.curves : end.surfaces)[entity][place];
        if (parts[at(from.node)] == 1) return to;
        const Eigen::Vector3d x = from.x + parts[at(from.node)] * (to.x - from.x);
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
