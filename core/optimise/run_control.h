// How a caller follows a run and steers it: callbacks, threads, checkpoints.
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>

#include "core/optimise/iteration.h"

namespace varimesh {

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

}  // namespace varimesh
