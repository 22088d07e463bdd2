#include "core/optimise/sequences/control_of_ranks.h"

#include <string_view>
#include <utility>

#include "core/device/fault.h"

namespace varimesh {
namespace {

/// Saves a checkpoint on the first rank. Writing it is work of all ranks, whatever comes of the saving.
void save_together(const RunControl& given, const Iteration& iteration, const WriteCheckpoint& write) {
  bool has_written = false;
  const WriteCheckpoint once = [&](const CheckpointSink& sink) {
    return !std::exchange(has_written, true) && write(sink);
  };
  if (given.ranks->is_first()) given.save_checkpoint(iteration, once);
  if (!has_written) write([](std::string_view) { return true; });
}

}  // namespace

Expected<RunControl> control_of_ranks(RunControl control, const Options& options) {
  if (control.ranks == nullptr || control.ranks->count() == 1) {
    control.ranks = nullptr;
    return control;
  }
  if (splits(options.repair)) return bad_option("Several processes that share a run split no elements.");
  if (control.checkpoint_due) {
    control.checkpoint_due = [given = control](const Iteration& iteration) {
      return given.ranks->any(given.ranks->is_first() && given.checkpoint_due(iteration));
    };
    control.save_checkpoint = [given = control](const Iteration& iteration, const WriteCheckpoint& write) {
      save_together(given, iteration, write);
    };
  }
  control.open_device = [] {
    return device::fault(device::Fault::Kind::NoDriver, "Several processes that share a run use no device.");
  };
  return control;
}

Control told_by_all(const OnIteration& on_iteration, const Iteration& iteration, const RunControl& control) {
  const Control mine = on_iteration ? on_iteration(iteration) : Control::Continue;
  if (control.ranks == nullptr) return mine;
  return control.ranks->any(mine == Control::Stop) ? Control::Stop : Control::Continue;
}

}  // namespace varimesh
