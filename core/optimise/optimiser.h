// The one thing the library does: move the free nodes until the mesh is valid and smooth.
#pragma once

#include <memory>
#include <vector>

#include "core/base/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/result.h"
#include "core/optimise/run_control.h"
#include "core/options/options.h"

namespace varimesh {

/// Optimises a mesh. Checks it and the options first: BadInput, BadOption. The same mesh in other units of length takes
/// the same path, and the result is the same bit for bit whatever the number of threads.
Expected<Result> optimise(HighOrderMesh mesh, const Options& options = {}, const OnIteration& on_iteration = {},
                          const RunControl& control = {});

/// What the mesh is, without optimising it: sizes, and how many nodes would move with these options.
Expected<MeshSummary> summarise(const HighOrderMesh& mesh, const Options& options = {});

/// Repeated work on one mesh topology (a moving boundary, a design loop): set up once, run for each set of coordinates.
class Optimiser {
 public:
  /// Checks the mesh and the options, colours the nodes and prepares the tables.
  static Expected<Optimiser> create(const HighOrderMesh& mesh, const Options& options = {});
  static Expected<Optimiser> create(HighOrderMesh&& mesh, const Options& options = {});

  /// Optimises the mesh with these coordinates (3 a node, interleaved, as HighOrderMesh::coordinates).
  /// Errors: BadInput where they are not finite or a straight-sided cell is inverted.
  Expected<Result> run(std::vector<double> coordinates, const OnIteration& on_iteration = {},
                       const RunControl& control = {});

  Optimiser(Optimiser&&) noexcept;
  Optimiser& operator=(Optimiser&&) noexcept;
  ~Optimiser();

 private:
  struct State;
  explicit Optimiser(std::unique_ptr<State> state);
  friend Expected<Result> optimise(HighOrderMesh mesh, const Options& options, const OnIteration& on_iteration,
                                   const RunControl& control);
  std::unique_ptr<State> state_;
};

}  // namespace varimesh
