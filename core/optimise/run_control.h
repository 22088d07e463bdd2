// How a caller follows and steers a run: callbacks, threads, checkpoints.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string_view>

#include "core/base/spare_memory.h"
#include "core/base/work_meter.h"
#include "core/device/device.h"
#include "core/mesh/high_order_mesh.h"
#include "core/optimise/iteration.h"
#include "core/validity/certificate.h"

namespace varimesh {

class Forecast;
class Ranks;
namespace device {
class RunDevice;
}

enum class Control : std::uint8_t { Continue, Stop };

/// Called after every iteration, one call at a time. Stop ends the run with the mesh as it is.
using OnIteration = std::function<Control(const Iteration&)>;

/// Takes the next bytes of a checkpoint. False if it wants no more.
using CheckpointSink = std::function<bool(std::string_view)>;
/// Writes a checkpoint piece by piece. False if the sink stopped it.
using WriteCheckpoint = std::function<bool(const CheckpointSink&)>;

/// The mesh as an iteration has left it, for those who watch the run.
struct MeshOnTheWay {
  HighOrderMesh& mesh;                       ///< A copy, which whoever is told may change.
  std::span<const double> scaled_jacobians;  ///< Of each cell, in the mesh's order, as in CellQuality.
  std::span<const Certificate> certificates;
};

/// What a run asks the caller. Everything except stop_asked is asked between iterations, on the thread that called the
/// run. Everything may be left empty.
struct RunControl {
  /// Whether to save a checkpoint after this iteration. Called before OnIteration: after Newton steps and steps of
  /// untangling, after rounds of Phase::Accuracy, and after sweeps whose number is a multiple of ten.
  std::function<bool(const Iteration&)> checkpoint_due;
  /// Called if checkpoint_due said yes. `write` works only during the call.
  std::function<void(const Iteration&, const WriteCheckpoint& write)> save_checkpoint;
  /// A checkpoint that a run on the same mesh with the same options (except threads, max_iterations and time_limit) has
  /// saved. This run goes on after the checkpoint's iteration. On a machine with the same vector instructions it ends
  /// with the same bytes as an uninterrupted run. Its history is complete, and its seconds go on. A checkpoint that is
  /// damaged, or for another mesh, other options or another version, is ignored: the run begins at the beginning. A run
  /// with Repair::Split is a sequence of runs. It makes the looks for splits between them again, and if only the part
  /// about the run under way is damaged, that run begins at its beginning.
  std::string_view checkpoint;
  /// How many threads the next iteration may use, at least 1. Called before each. If empty: Options::threads.
  std::function<int()> threads;
  /// Whether to end the run at once. It is asked all the time, by all threads of the run at the same time, until it
  /// says yes, so it must be quick: the load of an atomic flag. What is under way is given up, and the run ends as it
  /// does at Options::time_limit (optimiser.h).
  std::function<bool()> stop_asked;
  /// Counts the work inside iterations and between them. It must outlive the run. It may be null.
  WorkMeter* meter = nullptr;
  /// Opens the device if Options::device asks for one; a fault says why there is none. If the function is empty, the
  /// run opens the first card of this machine.
  std::function<device::Possible<std::unique_ptr<device::Device>>()> open_device;
  /// The device that the run uses, or null if it uses none. Set by optimise().
  device::RunDevice* device = nullptr;
  /// The run is a part of another, which has chosen `device` and says so in its result. Set by optimise().
  bool has_chosen_device = false;
  /// Is told what the run does, and estimates how long the run will still take. It may be null. Set by optimise().
  Forecast* forecast = nullptr;
  /// Asked for the Hessians of untangling if they need more than memory_needed() counts on. Without it the result is
  /// the same, but untangling of large patches takes up to fourteen times as long.
  SpareMemory spare_memory;
  /// Whether somebody wants to see the mesh as it is now. Called after OnIteration.
  std::function<bool()> mesh_wanted;
  /// Called if mesh_wanted said yes. The mesh may have lost certificates that the result will have.
  std::function<void(const MeshOnTheWay&)> show_mesh;
  /// Untangling takes small patches only: one layer of cells around the cells to be repaired, in place of two layers
  /// and then four. In the runs of Repair::Split this is so: a split does what a larger patch would do. On four meshes
  /// of CAD parts a second layer repaired nothing more, and two of them took four times as long.
  bool shallow_untangling = false;
  /// At the end, cells that have lost their certificate are untangled with their neighbours. If false, they only go
  /// back to where they had it.
  bool untangles_lost = true;
  /// If elements are left that are not certified valid, other runs follow that may mend them sooner, and time is short.
  /// So the run hands such a mesh out as soon as its own methods have done what they can: it does not lower the loss of
  /// accuracy, and tries no other energies and targets. Set by optimise_on_geometry().
  bool another_follows = false;
  /// The ranks that share this run; null: one process runs it. All ranks call optimise() with the same mesh and the
  /// same options. They share the steps of Newton's method and of the descent, certificates, samples of quality and
  /// losses, and each rank does the rest of the run by itself. All get the result that one process gets. A shared run
  /// uses no device and splits no elements.
  ///
  /// All ranks end a run together, if one of them is asked to, or its time is over, or its on_iteration says so. They
  /// look at that less often than one process: between iterations, at sums over all ranks, before certificates and
  /// samples. checkpoint_due and save_checkpoint are called on the first rank only, but all have them or none. `write`
  /// works once. All ranks have the same checkpoint, and any number of ranks goes on from what any other has saved.
  ///
  /// The object must outlive the run.
  const Ranks* ranks = nullptr;
};

}  // namespace varimesh
