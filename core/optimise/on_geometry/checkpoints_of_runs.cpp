#include "core/optimise/on_geometry/checkpoints_of_runs.h"

#include <cstdint>
#include <cstring>
#include <utility>

namespace varimesh {
namespace {

// A checkpoint is this text, the number of finished runs, for each of them the number of bytes and the bytes of its
// last checkpoint, and then the checkpoint of the run under way.
constexpr std::string_view kBegin = "VariMesh runs 1\n";

std::string_view bytes_of(const std::uint64_t& number) {
  return {reinterpret_cast<const char*>(&number), sizeof number};
}

/// Takes a number from the beginning of the bytes. False if there are too few.
bool take(std::string_view& bytes, std::uint64_t& number) {
  if (bytes.size() < sizeof number) return false;
  std::memcpy(&number, bytes.data(), sizeof number);
  bytes.remove_prefix(sizeof number);
  return true;
}

}  // namespace

CheckpointsOfRuns::CheckpointsOfRuns(const RunControl& asked) : asked_(asked) { read(asked.checkpoint); }

RunControl CheckpointsOfRuns::control_of_next(std::function<Iteration(Iteration)> numbered, bool is_same) {
  const std::size_t run = last_.size();
  RunControl control = asked_;
  control.checkpoint = is_same && run < restored_.size() ? restored_[run] : std::string_view();
  last_.emplace_back(control.checkpoint);
  // A run that was finished before has nothing to save, because the caller has a later checkpoint.
  if (!asked_.checkpoint_due || !is_same || run + 1 < restored_.size()) {
    control.checkpoint_due = nullptr;
    control.save_checkpoint = nullptr;
    return control;
  }
  control.checkpoint_due = [this, numbered](const Iteration& own) { return asked_.checkpoint_due(numbered(own)); };
  control.save_checkpoint = [this, numbered](const Iteration& own, const WriteCheckpoint& write_run) {
    asked_.save_checkpoint(numbered(own), [&](const CheckpointSink& sink) { return write(sink, write_run); });
  };
  return control;
}

bool CheckpointsOfRuns::write(const CheckpointSink& sink, const WriteCheckpoint& write_run) {
  const std::uint64_t finished = last_.size() - 1;
  if (!sink(kBegin) || !sink(bytes_of(finished))) return false;
  for (std::uint64_t run = 0; run < finished; ++run)
    if (!sink(bytes_of(last_[run].size())) || !sink(last_[run])) return false;
  std::string own;
  const bool is_whole = write_run([&](std::string_view bytes) {
    own += bytes;
    return sink(bytes);
  });
  if (is_whole) last_.back() = std::move(own);
  return is_whole;
}

void CheckpointsOfRuns::read(std::string_view checkpoint) {
  std::uint64_t finished = 0;
  if (!checkpoint.starts_with(kBegin)) return;
  checkpoint.remove_prefix(kBegin.size());
  if (!take(checkpoint, finished)) return;
  std::vector<std::string_view> parts;
  for (std::uint64_t run = 0; run < finished; ++run) {
    std::uint64_t size = 0;
    if (!take(checkpoint, size) || size > checkpoint.size()) return;
    parts.push_back(checkpoint.substr(0, size));
    checkpoint.remove_prefix(size);
  }
  parts.push_back(checkpoint);
  restored_ = std::move(parts);
}

}  // namespace varimesh
