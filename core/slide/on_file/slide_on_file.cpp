#include "core/slide/on_file/slide_on_file.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/association/file_parameters.h"
#include "core/association/own_boundary.h"
#include "core/association/plane/profile.h"
#include "core/association/smooth_joints.h"
#include "core/curve/curve.h"
#include "core/geometry/load.h"
#include "core/layers/nodes_that_stay.h"
#include "core/mesh/check.h"
#include "core/mesh/node_parameters.h"
#include "core/mesh/plane.h"
#include "core/slide/coupled/coupled.h"
#include "core/slide/slide.h"
#include "core/slide/surface_alone.h"

namespace varimesh {
namespace {

/// Whether `name` means the physical group of this dimension and tag, by its name, its tag or "dimension:tag". Groups
/// without a name are not in HighOrderMesh::physical_groups.
bool is_named(const HighOrderMesh& mesh, int dimension, int tag, const std::string& name) {
  const std::string number = std::to_string(tag);
  if (name == number || name == std::to_string(dimension) + ":" + number) return true;
  return std::ranges::any_of(mesh.physical_groups, [&](const PhysicalGroup& group) {
    return group.dimension == dimension && group.tag == tag && group.name == name;
  });
}

Expected<void> check_order(const HighOrderMesh& mesh, int order) {
  if (order == 0) return {};
  if (order < 2 || order > kMaxOrder)
    return bad_option("A curved mesh has order 2 to " + std::to_string(kMaxOrder) + ", not " + std::to_string(order) +
                      ".");
  if (mesh.order != 1)
    return bad_input("The mesh has order " + std::to_string(mesh.order) +
                     ", but only a mesh of order 1 can be curved. A mesh that is curved already can be optimised "
                     "with its geometry.");
  return {};
}

void append(std::vector<std::string>& all, const std::vector<std::string>& more) {
  all.insert(all.end(), more.begin(), more.end());
}

/// Associates, snaps, curves and slides one mesh.
struct Work {
  HighOrderMesh& mesh;
  const GeometryOptions& options;
  SlideOn what;
  const Team& team;
  /// Ends when the caller asks for it, but not when the time is over: a mesh that is not curved yet is no result.
  const Team& curving_team;
  bool in_plane;
  std::vector<std::string> sentences;
  SlideReport report = {};
  std::int64_t straight_elements = 0;
  std::optional<std::vector<double>> as_curved = std::nullopt;  ///< The coordinates before nodes slide,
  std::size_t sentences_as_curved = 0;                          ///< and the number of sentences.

  Expected<void> run(const geometry::Geometry& geometry) {
    Expected<Association> association;
    curving_team.run([&] { association = associated(geometry); });
    if (!association) return tl::unexpected(association.error());
    const bool joins = options.smooth_angle > 0 && mesh.order > 1 && what != SlideOn::None;
    const NodesWithParameters before(mesh);
    if (joins)
      sentences.push_back(join_smoothly(mesh, *association, options.smooth_angle * std::numbers::pi / 180).sentence());
    slide_nodes(mesh, *association);
    // Joined entities and planes have parameters of their own.
    joins || in_plane ? before.forget_moved(mesh) : keep_parameters(mesh, *association);
    return {};
  }

  Expected<void> run_on_boundary() {
    Expected<OwnBoundary> own;
    team.run([&] { own = own_boundary(mesh, team); });
    if (!own) return tl::unexpected(own.error());
    sentences.push_back(own->sentence());
    slide_nodes(own->faces, own->association);
    const NodesWithParameters before(mesh);
    mesh.coordinates = std::move(own->faces.coordinates);
    before.forget_moved(mesh);
    return {};
  }

 private:
  /// The association of the mesh, which may be snapped and curved.
  Expected<Association> associated(const geometry::Geometry& geometry) {
    auto association =
        in_plane ? associate_in_plane(mesh, geometry, curving_team) : associate(mesh, geometry, curving_team);
    if (!association) return association;
    append(sentences, in_plane ? describe_in_plane(mesh, *association, options.snap_tolerance)
                               : describe(mesh, *association, options.snap_tolerance));
    if (options.snap) {
      const std::size_t moved = snap(mesh, *association, options.snap_tolerance);
      sentences.push_back(std::to_string(moved) + " nodes were moved onto the geometry.");
    }
    if (options.order == 0) return association;
    auto curved = curve(mesh, *association, options.order, curving_team);
    if (!curved) return tl::unexpected(curved.error());
    append(sentences, curved->report.sentences());
    straight_elements = curved->report.straight;
    mesh = std::move(curved->mesh);
    as_curved = mesh.coordinates;
    sentences_as_curved = sentences.size();
    return std::move(curved->association);
  }

  /// Nodes of thin layers at curved walls stay.
  void hold_layers(const Association& association, std::vector<bool>& fixed) {
    if (mesh.dimension == 2 && !in_plane) return;
    std::vector<bool> in_layers;
    team.run([&] { in_layers = nodes_of_thin_layers(mesh, team); });
    if (in_layers.empty()) return;
    std::int64_t count = 0;
    for (std::size_t node = 0; node < fixed.size(); ++node) {
      if (!in_layers[node]) continue;
      fixed[node] = true;
      const int dimension = association.nodes[node].dimension;
      count += dimension >= 0 && dimension < mesh.dimension ? 1 : 0;
    }
    sentences.push_back(std::to_string(count) +
                        " boundary nodes are part of thin layers at curved walls and stay, so that the layers keep "
                        "their heights.");
  }

  /// @param boundary  the mesh, or its surface elements
  void slide_nodes(HighOrderMesh& boundary, Association& association) {
    auto fixed = nodes_of_groups(mesh, options.fix);
    assert(fixed);  // slide_on_file() has looked for the groups already
    if (what != SlideOn::None) hold_layers(association, *fixed);
    detail::CoupledReport coupled;
    if (mesh.dimension == 2 && !in_plane)
      report = detail::slide_alone(boundary, association, what, std::move(*fixed), team);
    else if (what == SlideOn::Coupled)
      report = detail::slide_coupled(boundary, association, *fixed, {options.tolerance, options.coupled_seconds}, team,
                                     coupled);
    else
      team.run([&] { report = slide(boundary, association, what, *fixed, team); });
    sentences.push_back(report.sentence(association.size));
    if (what == SlideOn::Coupled) sentences.push_back(coupled.sentence());
  }
};

/// What can be refused before a geometry is read.
/// @param in_plane  receives whether the mesh lies in a plane
Expected<void> check_with_mesh(const HighOrderMesh& mesh, const GeometryOptions& options, const Team& team,
                               bool& in_plane) {
  if (auto fine = check(options); !fine) return fine;
  if (options.slide == SlideOn::Coupled && mesh.dimension != 3)
    return bad_option(
        "slide is coupled, which moves the nodes inside volume elements too, and this mesh has none; choose all.");
  Expected<void> checked;
  // A mesh that is to be curved is no result before, even if the time is over.
  const Team checking = options.order > 0 ? team.without_stop() : team;
  checking.run([&] {
    checked = check_judgeable(mesh, checking);
    in_plane = checked && lies_in_a_plane(mesh, checking);
  });
  if (in_plane && options.on_boundary())
    return bad_input("The mesh lies in a plane, whose boundary is no guide to where nodes may slide; give a model.");
  if (in_plane && options.smooth_angle > 0)
    return bad_option("smooth_angle joins surfaces, and this mesh lies in a plane; leave it out.");
  if (checked) checked = check_order(mesh, options.order);
  if (!checked) return checked;
  if (const auto fixed = nodes_of_groups(mesh, options.fix); !fixed) return tl::unexpected(fixed.error());
  return {};
}

using Reason = StopToken::Reason;

/// @param model  null: the mesh's own boundary
Expected<SlidOnGeometry> slide_on(HighOrderMesh& mesh, const GeometryOptions& options, const Team& team,
                                  const geometry::Geometry* model, bool in_plane) {
  const StopToken asked(
      [&] { return options.stop != nullptr && options.stop->stopped() && options.stop->reason() == Reason::Asked; });
  Team curving_team(options.threads);
  curving_team.set_stop(options.order > 0 ? &asked : options.stop);
  Work work{mesh, options, options.slide, team, curving_team, in_plane, {}};
  if (model != nullptr) work.sentences = model->notes;
  const NodesWithParameters before(mesh);
  std::vector<double> coordinates = mesh.coordinates;
  std::optional<HighOrderMesh> straight;  // curving changes everything
  if (options.order > 0) straight = mesh;
  const auto go_back = [&] {
    if (straight)
      mesh = std::move(*straight);
    else
      mesh.coordinates = std::move(coordinates);
  };
  Expected<void> done;
  bool is_cut_short = false;
  try {
    done = model == nullptr ? work.run_on_boundary() : work.run(*model);
  } catch (const Interrupted&) {
    if (!work.as_curved) {
      go_back();
      throw;
    }
    is_cut_short = true;
    mesh.coordinates = std::move(*work.as_curved);
    before.forget_moved(mesh);  // those that were put on the geometry
    work.sentences.resize(work.sentences_as_curved);
    work.sentences.emplace_back("Sliding was cut short, so boundary nodes stay where curving has put them.");
  }
  if (!done) {
    go_back();
    return tl::unexpected(done.error());
  }
  return SlidOnGeometry{std::move(work.sentences), work.report, work.straight_elements, in_plane, is_cut_short};
}

Team team_of(const GeometryOptions& options) {
  Team team(options.threads);
  team.set_stop(options.stop);
  return team;
}

}  // namespace

Expected<std::vector<bool>> nodes_of_groups(const HighOrderMesh& mesh, const std::vector<std::string>& names) {
  std::vector<bool> fixed(mesh.node_count(), false);
  for (const std::string& name : names) {
    bool found = false;
    for (const ElementBlock& block : mesh.blocks) {
      const int dimension = reference::info(block.shape).dimension;
      const bool in_group =
          std::ranges::any_of(block.physical, [&](int tag) { return is_named(mesh, dimension, tag, name); });
      if (!in_group) continue;
      found = true;
      for (const std::int32_t node : block.nodes) fixed[static_cast<std::size_t>(node)] = true;
    }
    if (!found) return bad_option("The mesh has no elements of a physical group '" + name + "', which fix names.");
  }
  return fixed;
}

Expected<SlidOnGeometry> slide_on_model(HighOrderMesh& mesh, const GeometryOptions& options,
                                        const geometry::Geometry& model) {
  const Team team = team_of(options);
  bool in_plane = false;
  if (const auto fine = check_with_mesh(mesh, options, team, in_plane); !fine) return tl::unexpected(fine.error());
  return slide_on(mesh, options, team, &model, in_plane);
}

Expected<SlidOnGeometry> slide_on_boundary(HighOrderMesh& mesh, const GeometryOptions& options) {
  const Team team = team_of(options);
  bool in_plane = false;
  if (const auto fine = check_with_mesh(mesh, options, team, in_plane); !fine) return tl::unexpected(fine.error());
  return slide_on(mesh, options, team, nullptr, in_plane);
}

Expected<std::vector<std::string>> slide_on_file(HighOrderMesh& mesh, const GeometryOptions& options) {
  const Team team = team_of(options);
  bool in_plane = false;
  if (const auto fine = check_with_mesh(mesh, options, team, in_plane); !fine) return tl::unexpected(fine.error());
  Expected<geometry::Geometry> geometry;
  if (!options.on_boundary()) geometry = geometry::load(options.file);
  if (!geometry) return tl::unexpected(geometry.error());
  auto slid = slide_on(mesh, options, team, options.on_boundary() ? nullptr : &*geometry, in_plane);
  if (!slid) return tl::unexpected(slid.error());
  return std::move(slid->sentences);
}

}  // namespace varimesh
