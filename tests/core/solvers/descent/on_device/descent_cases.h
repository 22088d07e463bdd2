// Meshes, and what the descent minimises on them, for the tests of a device.
#pragma once

#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "core/base/index.h"
#include "core/kernels/p_norm.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/solvers/descent/loss_objective.h"
#include "core/solvers/descent/on_device/device_loss.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {

struct DescentCase {
  testing::Filling filling;
  int order;
  double shake = 0.02;
  Energy energy = Energy::Hyperelastic;
};
inline void PrintTo(const DescentCase& one, std::ostream* out) {
  *out << testing::name(one.filling) << one.order << (one.energy == Energy::Hyperelastic ? "" : "OtherEnergy");
}
inline std::string name_of(const DescentCase& one) {
  return std::string(testing::name(one.filling)) + std::to_string(one.order) +
         (one.energy == Energy::Hyperelastic ? "" : "OtherEnergy");
}

/// More than a batch of cells of some shapes, and batches that are not full.
inline HighOrderMesh mesh_of(const DescentCase& one) {
  HighOrderMesh mesh =
      testing::grid(one.filling, {3, 2, 2}, one.order, testing::bent(testing::is_plane(one.filling) ? 2 : 3));
  testing::shake(mesh, one.shake / (one.order * one.order), 5);
  return mesh;
}

/// A problem and what a round of the descent begins with: weights, frames, diagonals and held vertices.
class PreparedDescent {
 public:
  explicit PreparedDescent(const DescentCase& one, int threads = 1)
      : team_(threads),
        mesh_(mesh_of(one)),
        material_(varimesh::material(options_of(one))),
        problem_(testing::make_problem(mesh_)),
        kernels_(make_kernels(material_, problem_.dimension)),
        hessian_(make_hessian_kernels(material_, problem_.dimension)),
        energy_(problem_, *kernels_, *hessian_, PNorm{}, team_),
        weights_(at(problem_.cells)),
        space_(own_space(problem_, team_)),
        form_(problem_, space_, local_wave(mesh_), team_),
        levels_(problem_, space_, team_),
        processor_(problem_, energy_, form_, levels_, material_, team_),
        from_(free_positions(problem_, problem_.positions, team_)) {
    for (CellSet& set : problem_.sets) set.delta_squared.assign(at(set.count), 0.0);
    std::vector<double> stiff(weights_.size()), hold(weights_.size());
    for (const CellSet& set : problem_.sets)
      for (std::int32_t cell = 0; cell < set.count; ++cell) {
        const std::size_t i = at(set.first + cell);
        const double loss = 1e-3 * (1 + 0.1 * static_cast<double>(i % 7));
        weights_[i] = loss / cell_measure(set, cell);
        stiff[i] = loss;
        hold[i] = 10 * loss / (problem_.cell_size[i] * problem_.cell_size[i]);
      }
    energy_.weigh(weights_, problem_.cells);
    levels_.take_diagonals(form_, stiff);
    processor_.hold_vertices(hold, from_);
    // Vertices are held where they were, and the frames are those of that place.
    const std::vector<double> direction = testing::random_direction(problem_, 3);
    const std::size_t d = at(problem_.dimension);
    for (std::size_t i = 0; i < direction.size(); ++i)
      problem_.positions[at(problem_.free[i / d]) * d + i % d] += 0.1 * direction[i] / problem_.inverse_size[i / d];
    processor_.forget_form();
  }
  PreparedDescent(const PreparedDescent&) = delete;
  PreparedDescent& operator=(const PreparedDescent&) = delete;

  /// The same on a device.
  std::unique_ptr<DeviceLoss> on(device::Device& device) {
    auto there = std::make_unique<DeviceLoss>(device, problem_, energy_, form_, levels_, material_, team_);
    there->begin_round(processor_.hold(), from_);
    return there;
  }

  static Options options_of(const DescentCase& one) {
    Options options;
    options.energy = one.energy;
    return options;
  }

  const Team team_;
  const HighOrderMesh mesh_;
  const Material material_;
  Problem problem_;
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  CellEnergy energy_;
  std::vector<double> weights_;
  OrderSpace space_;
  ModalForm form_;
  OrderLevels levels_;
  LossObjective processor_;
  const std::vector<double> from_;
};

}  // namespace varimesh
