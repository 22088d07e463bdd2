// Runs for tests of stopping: every phase, shape and order; and what the result of a stopped run must be.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "core/mesh/changes/change_order.h"
#include "core/optimise/optimiser.h"
#include "core/validity/certificate.h"
#include "tests/core/layers/layer_meshes.h"
#include "tests/core/support/balls.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh::testing {

/// A run to stop.
struct RunToStop {
  std::string name;
  HighOrderMesh mesh;
  Options options;
};

/// A grid of bent cells whose inner nodes are pushed around.
inline HighOrderMesh pushed(Filling filling, std::array<int, 3> counts, int order, double push) {
  HighOrderMesh mesh = grid(filling, counts, order, bent(is_plane(filling) ? 2 : 3));
  shake(mesh, push, 7);
  return mesh;
}

inline RunToStop run_to_stop(const std::string& name, HighOrderMesh mesh, const std::function<void(Options&)>& set) {
  RunToStop run{name, std::move(mesh), {}};
  run.options.threads = 1;
  run.options.objective = Objective::Energy;
  run.options.max_iterations = 60;
  set(run.options);
  return run;
}

/// One run for each phase, on small meshes.
inline std::vector<RunToStop> runs_of_all_phases() {
  std::vector<RunToStop> runs;
  const auto add = [&](const std::string& name, HighOrderMesh mesh, const std::function<void(Options&)>& set) {
    runs.push_back(run_to_stop(name, std::move(mesh), set));
  };
  add("sweeps", pushed(Filling::MixedSolid, {4, 2, 2}, 2, 0.02), [](Options& o) {
    o.method = Method::Sweeps;
    o.max_iterations = 12;
  });
  add("sweeps_over_tangled_cells", pushed(Filling::Hexahedra, {3, 3, 2}, 3, 0.12), [](Options& o) {
    o.method = Method::Sweeps;
    o.max_iterations = 12;
  });
  add("newton", pushed(Filling::Hexahedra, {3, 3, 2}, 3, 0.02), [](Options& o) { o.method = Method::Newton; });
  add("newton_with_p_norm", pushed(Filling::Triangles, {4, 4, 1}, 4, 0.01), [](Options& o) { o.p_norm = 3; });
  add("untangling_triangles", pushed(Filling::Triangles, {6, 6, 1}, 4, 0.2),
      [](Options& o) { o.until = Until::Valid; });
  add("untangling_tetrahedra", pushed(Filling::Tetrahedra, {3, 3, 2}, 3, 0.15),
      [](Options& o) { o.until = Until::Valid; });
  add("splitting", six_in_a_ball(3), [](Options& o) { o.repair = Repair::Split; });
  add("straightening", two_in_a_ball(3), [](Options& o) { o.repair = Repair::Straighten; });
  add("worst", read_case("nine_triangles.msh"), [](Options& o) { o.objective = Objective::Worst; });
  add("accuracy", read_case("nine_triangles.msh"), [](Options& o) { o.objective = Objective::Accuracy; });
  add("accuracy_of_a_valid_mesh", pushed(Filling::Tetrahedra, {3, 3, 2}, 3, 0.01),
      [](Options& o) { o.objective = Objective::Accuracy; });
  add("part_of_the_way", make({Shape::Triangle, 3, 8, 0.135, 1.17, Inside::StraightSided}),
      [](Options& o) { o.objective = Objective::Accuracy; });
  add("raising_a_valid_mesh", pushed(Filling::Pyramids, {3, 3, 2}, 2, 0.02), [](Options& o) {
    o.objective = Objective::Accuracy;
    o.min_js = 0.8;
  });
  add("until_js", read_case("annulus_p3.msh"), [](Options& o) { o.until_js = 0.99; });
  add("change_of_order", pushed(Filling::Prisms, {2, 2, 2}, 2, 0.02), [](Options& o) { o.order = 4; });
  add("two_threads", pushed(Filling::Pyramids, {2, 2, 2}, 3, 0.08), [](Options& o) { o.threads = 2; });
  return runs;
}

/// Expects that the mesh is whole, that it is no worse than the input, and that its certificates are those that it gets
/// independently of the run.
inline void expect_sound(const RunToStop& run, const Result& result) {
  const HighOrderMesh input = run.options.order > 0 ? *change_order(run.mesh, run.options.order) : run.mesh;
  ASSERT_GE(result.mesh.node_count(), input.node_count());
  ASSERT_GE(result.mesh.element_count(input.dimension), input.element_count(input.dimension));
  const std::vector<bool> fixed = fixed_nodes(input);
  for (std::size_t n = 0; n < input.node_count(); ++n)
    ASSERT_TRUE(!fixed[n] ||
                std::memcmp(&input.coordinates[3 * n], &result.mesh.coordinates[3 * n], 3 * sizeof(double)) == 0)
        << "fixed node " << n;
  const std::vector<Certificate> before = certify(input, {}, 1), after = certify(result.mesh, {}, 1);
  const auto valid = [](const std::vector<Certificate>& all) {
    return std::ranges::count_if(all, &Certificate::is_valid);
  };
  EXPECT_LE(static_cast<std::int64_t>(after.size()) - valid(after),
            static_cast<std::int64_t>(before.size()) - valid(before));
  const Cells cells(result.mesh, result.mesh.dimension);
  std::set<std::int64_t> uncertified;
  for (const UncertifiedElement& element : result.after.uncertified) uncertified.insert(element.number);
  for (std::size_t c = 0; c < after.size(); ++c) {
    EXPECT_TRUE(after[c].is_valid() || uncertified.contains(cells.number(c))) << "element " << cells.number(c);
    if (run.options.repair == Repair::Split) continue;  // the cells have other numbers
    EXPECT_TRUE(after[c].is_valid() || !before[c].is_valid()) << "cell " << c;
  }
  // Only an element that there was no time to certify may be valid without a certificate: then nothing was iterated.
  const std::int64_t unproved = std::ssize(after) - valid(after);
  EXPECT_GE(static_cast<std::int64_t>(uncertified.size()), unproved);
  if (result.iterations > 0) {
    EXPECT_EQ(static_cast<std::int64_t>(uncertified.size()), unproved);
  }
  const CertificateSummary& certified = result.after.certified;
  EXPECT_EQ(certified.valid + certified.invalid + certified.undecided, std::ssize(after));
  EXPECT_EQ(static_cast<std::int64_t>(uncertified.size()), certified.invalid + certified.undecided);
  EXPECT_EQ(result.history.size(), static_cast<std::size_t>(result.iterations));
}

}  // namespace varimesh::testing
