// The descent from a valid mesh to the least loss of accuracy, with the energy as its barrier.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "core/base/team.h"
#include "core/base/work_meter.h"
#include "core/energy/material.h"
#include "core/merit/merit.h"
#include "core/quality/quality.h"
#include "core/solvers/checkpoint.h"
#include "core/solvers/descent/form/modal_form.h"
#include "core/solvers/descent/form/order_levels.h"
#include "core/solvers/descent/form/order_space.h"
#include "core/solvers/descent/loss_objective.h"
#include "core/solvers/guard/guard.h"
#include "core/solvers/newton_method.h"
#include "core/terms/cell_energy.h"
#include "core/terms/part/problem_part.h"
#include "core/validity/certifier.h"

namespace varimesh {

class DeviceLoss;
namespace device {
class RunDevice;
struct Fault;
}  // namespace device
namespace detail {
class SamplesElsewhere;
}

/// What a descent works with. All of it outlives the descent.
struct DescentContext {
  const HighOrderMesh& mesh;
  Problem& problem;
  const Kernels& kernels;
  const HessianKernels& hessian;
  Material material;
  Guard& guard;
  const Certifier& certifier;
  const Team& team;
  Asked asked;              ///< asked_by() the options of the run.
  bool came_valid = false;  ///< `mesh` was valid, so the loss must not end above the loss of `mesh`.
  /// The quality of `mesh`. The best mesh does not have both a smaller minimum of the scaled Jacobian than this, by
  /// more than 0.001, and a smaller mean. Null: the best mesh may have both.
  const QualityReport* least = nullptr;
  /// By cell: the factor by which ε_e is raised at the beginning. Empty: 1.
  std::vector<double> factors = {};
  WorkMeter* meter = nullptr;  ///< Counts what the kernels do; may be null.
  /// Makes the steps, as long as it is used; may be null, or without a device.
  device::RunDevice* device = nullptr;
  /// Samples cells (certified_quality.h); may be null.
  detail::SamplesElsewhere* samples = nullptr;
  /// The ranks that share the steps; otherwise all ranks have the same context. With ranks there is no device and no
  /// token. Null: there are no ranks.
  const Ranks* ranks = nullptr;
};

/// What one round did.
struct DescentRound {
  double residual = 0;           ///< The largest displacement of a node in the round, in units of the size of the
                                 ///< cells around it (sizes.h).
  double relative_gradient = 0;  ///< The norm of the last gradient relative to the first one of the descent.
  double energy = 0;             ///< Σ ∫ W |det A| over the cells, divided by Σ ∫ |det A|.
  /// The smallest one at the quadrature points; if cells have lost their certificate and gone back, at least the proved
  /// minimum of the mesh.
  double min_scaled_jacobian = 0;
  int steps = 0;           ///< Products of the second derivative.
  bool on_device = false;  ///< A device has made steps of it.
  bool last = false;       ///< Another round would gain nothing.
};

/// Minimises over the free nodes
///
///     Q(x) + 1/N Σ_e ε_e [1/V_e ∫_e W(F) + 10 mean over the vertices v of e of |x_v − X_v|²/h_e²],
///
/// Q being the squared local loss of accuracy (modal_form.h), N the number of cells, V_e their volumes and h_e their
/// heights. Q alone keeps no cell valid; the energy keeps cells valid, as a barrier. Q does not know where vertices
/// are. The last term keeps vertices near X_v, their places at the beginning, so what is far from a node does not move
/// it. ε_e is the squared loss of the cells around (loss_around.h) times a constant, so it falls from round to round,
/// and cells far away do not change it.
///
/// A round takes one Newton step with given ε_e and with Q's frames taken from the mesh at its beginning, and more
/// steps while nodes still move far. The rounds end when all further rounds together would move no node by a thousandth
/// of a cell, or when no loss is left that is worth a move. After a round, the cells whose scaled Jacobian is too low
/// take four times their ε_e. docs/accuracy.md has the figures.
///
/// Q knows only the frames at the beginning of a round. If the loss has risen by much at the end of the round, as it
/// does in thin cells that move far, the mesh goes back to the beginning of the round, and ε_e becomes larger in all
/// cells.
///
/// Certificates are kept (guard.h): a round that costs a cell its certificate puts the cell's nodes back. If the rounds
/// end like that below the bound on the scaled Jacobian, more rounds follow, in which such cells are first raised in
/// small patches (kept_raiser.h). The best mesh so far is kept whatever the rounds after it do.
///
/// The steps are made on the context's device, if it has one; all work between two rounds is done on the processor.
/// After a fault of the device, this step and all further steps are made on the processor.
///
/// With ranks, each rank has the whole problem and works on a part of it in a step. All ranks call all functions
/// together, and all have the same results, with the bits of a descent without ranks. Each rank does all work between
/// two rounds.
class Descent {
 public:
  /// problem.positions are the positions of the guard's kept state. Call the constructor inside team.run(), and all
  /// other functions outside. The team's token may interrupt all of them.
  explicit Descent(const DescentContext& context);
  Descent(const Descent&) = delete;
  Descent& operator=(const Descent&) = delete;
  ~Descent();

  /// Makes the mesh as it is the best mesh so far, or the mesh as it came if that one is better. Call it before the
  /// first round. False if there is no loss to lower: the elements are straight-sided, or the mesh came in valid and
  /// its curvature costs a solver next to nothing beside the size of the cells, or the mesh keeps invalid cells and its
  /// curvature costs less than half of what the size does (has_loss.h).
  bool begin();

  /// The rounds end when all further rounds together would move no node by more than this, in units of the size of the
  /// cells around the node.
  static constexpr double kSettled = 1e-3;

  /// What to say if begin() returns false and the best mesh keeps invalid cells.
  static constexpr const char* kNotWorthIt =
      "Elements stay invalid, and the curvature of the mesh costs a solver less than half of what the size of its "
      "elements does, so its loss of accuracy was not lowered further.";

  /// One round. If the token interrupts it, the best mesh is the same as before.
  DescentRound round();

  /// A mesh, and what is known about it.
  struct State {
    std::vector<double> coordinates;  ///< 3 per node, interleaved, as HighOrderMesh::coordinates.
    std::vector<Certificate> certificates;
    Merit merit = Merit::of_nothing();  ///< Its minimum is proved.
  };
  /// The best mesh so far: What::Loss of core/merit/merit.h, with the scaled Jacobian of the context as the bound.
  const State& best() const { return best_; }

  /// Writes what the rounds so far have left, beside problem.positions and the guard's state, to a checkpoint, which
  /// does not depend on the number of ranks.
  void write(CheckpointWriter& writer);
  /// In place of the constructor and begin(): goes on from such a checkpoint. problem.positions and the guard have the
  /// state of that moment. Inside team.run(). The reader has failed if the checkpoint is of another problem.
  static void read(std::optional<Descent>& descent, const DescentContext& context, CheckpointReader& reader);

  /// Whether the best mesh has a lower loss than the mesh at the beginning, by more than next to nothing, and is valid.
  bool has_gained() const;

  /// By what share of the loss at the beginning the best mesh has lowered it; negative if its loss is higher.
  double gain() const { return start_loss_ > 0 ? 1 - best_.merit.loss / start_loss_ : 0; }

  /// Whether another descent from the best mesh, with targets from there, would change next to nothing: the last round
  /// ended because no node would move any more or no loss is worth a move, or no round has found a better mesh than the
  /// one at the beginning, from which the other descent would repeat this one.
  bool has_converged() const;

  /// By cell: the factor by which ε_e has been raised.
  const std::vector<double>& factors() const { return factors_; }

  State take_best() { return std::move(best_); }

 private:
  /// Whether the mesh keeps invalid cells, and is not worth a descent for that (size_decides()).
  bool stays_invalid_for_size() const;
  /// The state that the guard keeps.
  State kept_state() const;
  /// The same state without its coordinates. Few such states become the best one, and only these need a copy.
  State judged_kept_state() const;
  State state_as_it_came() const;
  /// Whether a state with this merit does not meet DescentContext::least.
  bool lowers(const Merit& merit, std::span<const double> coordinates) const;
  /// Makes a state of judged_kept_state() the best one, and gives it its coordinates.
  void take_for_best(State state);
  /// Sets what the certificates of a mesh with its nodes at `coordinates` say. Call it inside team.run().
  void judge(std::span<const double> coordinates, State& state) const;
  /// Whether it is valid, reaches the bound and is not lower than the mesh as it came.
  bool is_acceptable(const State& state) const {
    return state.merit.uncertified == 0 && reaches_bound(state) && !state.merit.lower_than_it_came;
  }
  void start_from(State state);
  bool reaches_bound(const State& state) const { return state.merit.smallest >= asked_.bound; }
  void set_weights();
  void minimise(DescentRound& round);
  const Ranks& sharers() const { return context_.ranks != nullptr ? *context_.ranks : one_rank(); }
  const ProblemPart* part() const { return part_ ? &*part_ : nullptr; }
  /// With ranks: gets what the others know after a step.
  void gather_parts();
  /// By CellSet::first + cell of the whole problem: loss_around() of the last ModalForm::gradient().
  std::vector<double> losses_around() const;
  /// Of the barrier's last evaluation, by CellSet::first + cell of the whole problem.
  std::span<const CellScan> scans() const { return part_ ? scans_ : barrier_.scans(); }
  /// Brings what a round begins with to the device, if there is one.
  void begin_on_device();
  /// One step of a method that minimises the objective on the device, if it is there, or the one on the processor.
  NewtonOutcome step(std::optional<NewtonMethod>& method, DescentRound& round);
  void leave_device(const device::Fault& fault);
  /// Whether the rounds with the present factors move no node any more, if the last one moved one by `move`.
  bool comes_to_rest(double move) const;
  bool refines(const Merit& merit) const;
  bool comes_to_bound();
  bool is_worth_more(const Merit& merit) const;
  void keep_certificates();
  /// Gives cells with a scaled Jacobian below `wanted` more weight; returns how many there are. `margin`: how far the
  /// scans, which see quadrature points only, may be above the smallest value of a cell.
  std::int64_t raise_low(double wanted, double margin, const std::vector<Certificate>& certificates);
  void note_scans(DescentRound& round) const;
  void accept(const State& state);
  template <class Archive>
  void state(Archive& archive);
  /// Inside team.run(): sets what follows from the state that was read. Returns false if it is of another problem.
  bool restore(const std::vector<double>& accepted);
  bool begin_to_raise_lost();
  void take_back();

  /// Rounds by which it is judged whether the bound is in reach.
  static constexpr std::size_t kRoundsOfPace = 3;

  DescentContext context_;
  Problem& problem_;
  const Team& team_;
  std::optional<ProblemPart> part_;  ///< With ranks: what this one works on.
  std::vector<CellScan> scans_;      ///< With ranks: see scans().
  Problem& own_;                     ///< The problem of the part; without ranks, the whole one.
  std::vector<double> from_;         ///< Where the free nodes of own_ were at the beginning.
  OrderSpace space_;
  CellEnergy barrier_;  ///< 1/N Σ_e ε_e/V_e ∫ W(F) dx
  ModalForm form_;      ///< In the room of barrier_.
  OrderLevels levels_;
  LossObjective objective_;
  /// Minimises the same on the device. Null before the first round, without a device, and after its fault.
  std::unique_ptr<DeviceLoss> on_device_;
  bool tries_device_ = true;       ///< The device has not been tried. It is tried once.
  std::vector<double> factors_;    ///< By cell: what ε_e has been raised by.
  std::vector<double> weights_;    ///< By cell of own_: ε_e/V_e.
  std::vector<char> lost_;         ///< By cell of the problem: it lost its certificate in the last round.
  std::vector<char> uncertified_;  ///< By cell of the problem: it had no certificate after the last round.
  double first_gradient_ = 0;
  double start_loss_ = 0, last_loss_ = 0;
  int raises_ = 0;            ///< Also counts the rounds that were taken back.
  double caution_ = 1;        ///< What all ε_e are raised by.
  bool raises_lost_ = false;  ///< A round raises the cells that lost their certificate before they are put back.
  bool is_at_rest_ = false;   ///< The last round came to rest with no low cell, or left no loss worth a move.
  int settling_ = 0;          ///< Rounds since one changed a factor.
  /// The minimum of the scaled Jacobian when the rounds last came to an end; −∞ if they have not.
  double settled_js_ = -std::numeric_limits<double>::infinity();
  double last_move_ = 0;          ///< Of the round before, 0 if that has changed a factor.
  bool best_settling_ = false;    ///< The best mesh is from these rounds.
  std::vector<double> accepted_;  ///< Of all nodes of the problem: where the round begins.
  double accepted_loss_ = 0, accepted_js_ = -1;
  Asked asked_;
  /// The highest minimum after each of the last rounds, the earliest first.
  std::vector<double> earlier_minima_;
  State best_;
};

}  // namespace varimesh
