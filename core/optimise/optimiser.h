// Optimises a mesh: moves its free nodes until every element is valid, and then lowers the error that curved elements
// cost a solver.
#pragma once

#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/result.h"
#include "core/optimise/run_control.h"
#include "core/options/options.h"

namespace varimesh {

struct CheckedMesh;
struct SetUp;

/// Optimises a mesh. Checks the mesh and the options first. Errors: BadInput, BadOption. The same mesh in other units
/// of length takes the same path. The result is the same bit for bit for every number of threads.
///
/// If the time limit passes or RunControl::stop_asked says yes, the run gives up the iteration that is under way and
/// ends with the best mesh of those before, with all certificates that are known. It takes at most half a second plus a
/// tenth of a second per 100,000 elements for that. If this is not enough for the quality report `after`, the report
/// samples the elements on a coarser lattice (QualityReport::lattice_intervals is 2). If the run is stopped before its
/// first iteration, the mesh is as it came, `before` is also `after`, and elements that there was no time to certify
/// are undecided. A run that goes on from a checkpoint is not stopped before it has the state of the checkpoint.
Expected<Result> optimise(HighOrderMesh mesh, const Options& options = {}, const OnIteration& on_iteration = {},
                          const RunControl& control = {});

/// The same for a mesh that is checked for optimising. The seconds of the check count.
Expected<Result> optimise(CheckedMesh mesh, const Options& options = {}, const OnIteration& on_iteration = {},
                          const RunControl& control = {});

/// The sizes of a mesh, and how many nodes would move with these options. Nothing is optimised. The mesh may be a
/// surface in space, whose nodes would not move. Errors: BadInput, BadOption.
Expected<MeshSummary> summarise(const HighOrderMesh& mesh, const Options& options = {});
/// The same for a mesh that is checked for judging.
Expected<MeshSummary> summarise(const CheckedMesh& mesh, const Options& options = {});

/// Repeated work on one mesh topology (a moving boundary, a design loop): set up once, run for each set of coordinates.
class Optimiser {
 public:
  /// Checks the mesh and the options, colours the nodes and prepares the tables. Errors: BadInput, BadOption.
  static Expected<Optimiser> create(const HighOrderMesh& mesh, const Options& options = {});
  static Expected<Optimiser> create(HighOrderMesh&& mesh, const Options& options = {});

  /// Optimises the mesh with these coordinates (3 per node, interleaved, as HighOrderMesh::coordinates).
  /// Errors: BadInput if there are too few or too many, or if one is not finite.
  Expected<Result> run(std::vector<double> coordinates, const OnIteration& on_iteration = {},
                       const RunControl& control = {});

  Optimiser(Optimiser&&) noexcept;
  Optimiser& operator=(Optimiser&&) noexcept;
  ~Optimiser();

 private:
  explicit Optimiser(std::unique_ptr<SetUp> set_up);
  std::unique_ptr<SetUp> set_up_;
};

}  // namespace varimesh
