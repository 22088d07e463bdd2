// The one thing the library does: move the free nodes until the mesh is valid and smooth.
#pragma once

#include <functional>
#include <memory>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/options.h"
#include "core/quality/diagnosis.h"
#include "core/quality/quality.h"
#include "core/repair/repair_step.h"

namespace varimesh {

/// What part of the method an iteration belongs to.
enum class Phase : std::uint8_t { Sweeps, Newton, Untangle };

/// What is known after an iteration (a sweep, a Newton step, or a step of untangling: at most three Newton steps in
/// every patch). Residuals and Jacobians are dimensionless.
struct Iteration {
  Phase phase = Phase::Sweeps;
  int number = 0;                        ///< 1, 2, … through the whole run.
  double energy = 0;                     ///< Σ ∫ W(F) |det ∇χ_L| dξ divided by Σ ∫ |det ∇χ_L| dξ.
  double residual = 0;                   ///< Largest displacement of a node in the full step, before damping, over the
                                         ///< diagonal of the bounding box.
  double relative_gradient = 0;          ///< Norm of the energy's gradient relative to that of the first iteration.
  double min_scaled_jacobian = 0;        ///< At the quadrature points: cheaper than the report's, and never below it.
  std::int64_t invalid_elements = 0;     ///< Cells that are not certified valid; while sweeps go over a mesh that is
                                         ///< all valid this is looked at every fourth.
  std::int64_t repairable_elements = 0;  ///< Those of them that are not named unrepairable.
  std::int64_t active_nodes = 0;         ///< Free nodes visited.
  int products = 0;    ///< Of the Hessian and a direction: conjugate-gradient iterations. Newton only.
  double seconds = 0;  ///< Since the optimisation began.
};

/// Why a run ended.
enum class StopReason : std::uint8_t {
  Converged,   ///< The residual is at most the tolerance.
  Valid,       ///< Until::Valid: every cell is certified valid.
  Repaired,    ///< Until::Valid: every cell that is not certified valid is named unrepairable.
  NoProgress,  ///< Until::Valid: ten iterations brought no fewer uncertified cells; or no lower energy was found.
  Quality,     ///< until_js is reached.
  TimeLimit,
  Iterations,  ///< max_iterations.
  Stopped,     ///< Control::Stop.
};

enum class Control : std::uint8_t { Continue, Stop };

/// Called after every iteration, one call at a time; Stop ends the run with the mesh as it is.
using OnIteration = std::function<Control(const Iteration&)>;

/// Takes the next bytes; false: it wants no more of them.
using CheckpointSink = std::function<bool(std::string_view)>;
/// Writes a checkpoint piece by piece; false where the sink stopped it.
using WriteCheckpoint = std::function<bool(const CheckpointSink&)>;

/// What a run asks between its iterations, from the thread that called it. All may be left empty.
struct RunControl {
  /// Whether the state after this iteration is to be kept. Asked after Newton steps and steps of untangling, and after
  /// sweeps whose number is a multiple of ten; before OnIteration.
  std::function<bool(const Iteration&)> checkpoint_due;
  /// Called where it is; `write` works during the call alone.
  std::function<void(const Iteration&, const WriteCheckpoint& write)> save_checkpoint;
  /// What such a `write` wrote, of the same mesh and the same options (but for threads, max_iterations and time_limit):
  /// the run goes on behind that iteration and ends with the same bytes as one that nothing interrupted, on a machine
  /// with the same vector instructions. Its history is whole, and its seconds go on. A checkpoint of another mesh, of
  /// other options or of another version, or one that is damaged, is passed over: the run begins at the beginning.
  std::string_view checkpoint;
  /// How many threads the next iteration may use, at least 1; asked before each. Without it: Options::threads.
  std::function<int()> threads;
  /// Whether the run is to end as by Control::Stop: asked where nothing is iterated, between the steps of splitting.
  std::function<bool()> stop_asked;
};

/// Sizes of the problem.
struct MeshSummary {
  int dimension = 0;
  int order = 0;
  std::int64_t elements = 0;    ///< Cells of the highest dimension.
  std::int64_t nodes = 0;       ///< All nodes of the file.
  std::int64_t free_nodes = 0;  ///< Nodes that may move.
};

/// What came of an optimisation.
struct Result {
  /// The mesh that came in with new coordinates; coordinates of fixed nodes bit for bit the same. A cell that came in
  /// certified valid is certified valid here too, however the run ended. With Repair::Split it may have more elements
  /// and nodes, numbered above those that came in.
  HighOrderMesh mesh;
  MeshSummary summary;  ///< Of this mesh.
  int iterations = 0;
  int resumed_from = 0;  ///< The iteration behind which a checkpoint let the run go on; 0: it began at the beginning.
  double seconds = 0;    ///< From the mesh as handed in to the result in memory, reports included.
  double proof_seconds = 0;  ///< Of these, for certificates and for finding what cannot be repaired.
  double residual = 0;       ///< Of the last iteration.
  bool converged = false;    ///< residual ≤ tolerance.
  bool stopped = false;      ///< Ended by Control::Stop.
  StopReason stop_reason = StopReason::Iterations;
  QualityReport before;
  QualityReport after;
  std::vector<UnrepairableGroup> unrepairable;  ///< What no movement of free nodes can repair.
  std::vector<RepairStep> repairs;              ///< What Repair::Split or Straighten did about it, in order.
  std::vector<Iteration> history;
};

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
