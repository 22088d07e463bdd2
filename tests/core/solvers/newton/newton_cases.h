// Meshes, and what Newton's method needs on them, for the tests of a device.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <ostream>
#include <vector>

#include "core/solvers/newton/newton.h"
#include "core/solvers/sweeps/sweep.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {

/// A problem, and its kernels with those of Newton's method.
class PreparedNewton {
 public:
  PreparedNewton(const HighOrderMesh& mesh, const Options& options)
      : material_(varimesh::material(options)),
        problem_(testing::make_problem(mesh)),
        kernels_(make_kernels(material_, problem_.dimension)),
        hessian_(make_hessian_kernels(material_, problem_.dimension)),
        norm_{options.p_norm},
        sweeper_(problem_, schedule_, *kernels_, Regularisation::Element, norm_, -1.0, team_) {
    sweeper_.rebuild();
    seen_ = sweeper_.scan();
    drop_deformation(problem_);
  }
  PreparedNewton(const PreparedNewton&) = delete;
  PreparedNewton& operator=(const PreparedNewton&) = delete;

  NewtonOutcome step(Newton& newton) {
    NewtonOutcome outcome;
    team_.run([&] {
      outcome = newton.step();
      sweeper_.changed(newton.scans());
    });
    seen_ = sweeper_.scan();
    drop_deformation(problem_);
    return outcome;
  }
  /// Puts the nodes there.
  void put(const std::vector<double>& positions) {
    problem_.positions = positions;
    sweeper_.rebuild();
    seen_ = sweeper_.scan();
    drop_deformation(problem_);
  }
  void begin(std::optional<Newton>& newton, double tolerance = 1e-6) {
    newton.emplace(problem_, *kernels_, *hessian_, norm_, tolerance, team_);
  }
  void begin(std::optional<Newton>& newton, device::RunDevice& device, double tolerance = 1e-6) {
    newton.emplace(problem_, *kernels_, *hessian_, norm_, tolerance, team_, device, material_);
  }

  Team team_{1};
  ColouredNodes schedule_;
  const Material material_;
  Problem problem_;
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  const PNorm norm_;
  Sweeper sweeper_;
  ScanOutcome seen_;
};

struct NewtonCase {
  const char* name;
  testing::Filling filling;
  int order;
  double shake;
  double p_norm = 1;
  Energy energy = Energy::Hyperelastic;
};
inline void PrintTo(const NewtonCase& one, std::ostream* out) { *out << one.name; }

/// Its boundary is curved, so that the energy of the optimum is not 0.
inline HighOrderMesh mesh_of(const NewtonCase& one) {
  // Cells of order 6 have a hundred times the work of those of order 3.
  const std::array<int, 3> cubes = one.order < 6 ? std::array{4, 3, 2} : std::array{2, 1, 1};
  HighOrderMesh mesh =
      testing::grid(one.filling, cubes, one.order, testing::bent(testing::is_plane(one.filling) ? 2 : 3));
  for (std::size_t node = 0; node < mesh.node_count(); ++node) {
    const double x = mesh.coordinates[3 * node];
    mesh.coordinates[3 * node + 1] += 0.1 * x * x;
  }
  testing::shake(mesh, one.shake / std::pow(one.order, 2), 7);
  return mesh;
}
inline Options options_of(const NewtonCase& one) {
  Options options;
  options.p_norm = one.p_norm;
  options.energy = one.energy;
  return options;
}

}  // namespace varimesh
