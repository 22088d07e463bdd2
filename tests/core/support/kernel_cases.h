// Curved meshes as the kernels see them, for every energy with a few mixtures of shapes: valid and tangled, with and
// without a metric.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "core/kernels/kernels.h"
#include "core/problem/target_field.h"
#include "core/problem/targets.h"
#include "core/solvers/sweeps/sweep.h"
#include "tests/core/energy/materials.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh::testing {

struct KernelCase {
  NamedMaterial material;
  Filling filling;
};

inline std::string name(const KernelCase& one) { return one.material.name + name(one.filling); }

inline void PrintTo(const KernelCase& one, std::ostream* out) { *out << name(one); }

inline std::vector<KernelCase> every_kernel_case() {
  std::vector<KernelCase> cases;
  for (const NamedMaterial& material : every_material())
    for (const Filling filling : {Filling::Triangles, Filling::MixedPlane, Filling::Tetrahedra, Filling::MixedSolid})
      cases.push_back({material, filling});
  return cases;
}

/// What is done to a mesh before it is handed to the kernels.
struct Treatment {
  bool tangled;  ///< Shaken so much that some cells are invalid.
  bool metric;   ///< The target has a metric, whose axes lie across the grid's.
};
inline constexpr Treatment kTreatments[] = {{false, false}, {true, false}, {false, true}, {true, true}};

/// A mesh of the case, with vectorised and plain kernels and the deformation gradients in place.
class KernelCases : public ::testing::TestWithParam<KernelCase> {
 protected:
  void prepare(bool tangled, bool metric = false) {
    const bool plane = is_plane(GetParam().filling);
    HighOrderMesh mesh = grid(GetParam().filling, {3, 2, 2}, 3, bent(plane ? 2 : 3));
    shake(mesh, tangled ? 0.12 : 0.01, 7);
    problem_ = make_problem(mesh);
    mesh_ = std::move(mesh);
    if (metric) set_target(Target::Size, metric_field());
    fast_ = make_kernels(GetParam().material.material, problem_.dimension);
    plain_ = make_plain_kernels(GetParam().material.material, problem_.dimension);
    sweeper_.emplace(problem_, schedule_, *plain_, Regularisation::Element, PNorm{}, -1.0, team_);
    sweeper_->rebuild();
    invalid_ = sweeper_->scan().invalid;
  }

  void set_target(Target target, TargetField values) {
    Options options;
    options.target = target;
    options.target_field = std::move(values);
    const auto field = resolve_target_field(mesh_, options);
    ASSERT_TRUE(field) << field.error().sentence;
    set_targets(problem_, *field, frame_of(mesh_).diagonal);
  }

  /// Edges of about 0.3 with a ratio of 4 and more, finer from left to right.
  TargetField metric_field() const {
    TargetField field{Per::Vertex, mesh_.dimension == 2 ? 3 : 6, {}, {}};
    for (std::size_t n = 0; n < mesh_.node_count(); ++n) {
      const double fineness = 1 + 0.5 * mesh_.coordinates[3 * n];
      for (const double entry : {8.0, 11.0, 40.0, -3.0, 9.0, 14.0})
        if (field.values.size() < (n + 1) * std::size_t(field.components)) field.values.push_back(fineness * entry);
    }
    return field;
  }

  HighOrderMesh mesh_;
  Problem problem_;
  ColouredNodes schedule_;
  Team team_{1};
  std::unique_ptr<Kernels> fast_, plain_;
  std::optional<Sweeper> sweeper_;
  std::int64_t invalid_ = 0;
};

}  // namespace varimesh::testing
