#include "core/optimise/sequences/run_sequence.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "core/optimise/sequences/kept_result.h"
#include "core/optimise/sequences/work.h"

namespace varimesh {
namespace {

/// Newton steps before the first split. On meshes that stay tangled, Newton does not end by itself.
constexpr int kBriefIterations = 40;

}  // namespace

RunControl control_of_each_run(const RunControl& asked) {
  RunControl control = asked;
  control.checkpoint_due = nullptr;
  control.save_checkpoint = nullptr;
  control.checkpoint = {};
  control.shallow_untangling = true;
  return control;
}

RunSequence::RunSequence(const Options& options, std::uint64_t fingerprint, const OnIteration& on_iteration,
                         const RunControl& control, StopToken& stop)
    : options_(options),
      fingerprint_(fingerprint),
      on_iteration_(on_iteration),
      asked_(control),
      stop_(stop),
      control_(control_of_each_run(control)) {
  options_.repair = Repair::Report;
  options_.order = 0;
  restores_ = read(control.checkpoint);
}

void RunSequence::begin_rounds(double work) {
  most_work_ = work_ + work;
  control_.untangles_lost = false;
}

void RunSequence::end_rounds(double work) {
  most_work_ = work_ + work;
  control_.untangles_lost = true;
}

void RunSequence::note_groups(std::int64_t groups) {
  groups_left_ = groups;
  if (control_.meter == nullptr) return;
  control_.meter->found_groups(groups);
  control_.meter->begin(Activity::Splits);
  control_.meter->add(++looks_);
}

bool RunSequence::may_go_on() const {
  if (out_of_work()) return false;
  return restores_ || (!stopped() && static_cast<int>(history_.size()) < options_.max_iterations &&
                       (options_.time_limit <= 0 || watch_.seconds() < options_.time_limit));
}

// ===== runs =====

std::optional<Result> RunSequence::run_briefly(const HighOrderMesh& mesh) {
  const Options whole = options_;
  if (options_.method == Method::Auto) options_.method = Method::Newton;
  options_.max_iterations = std::min(options_.max_iterations, static_cast<int>(history_.size()) + kBriefIterations);
  std::optional<Result> result = run(mesh);
  options_ = whole;
  return result;
}

std::optional<Result> RunSequence::run(const HighOrderMesh& mesh) {
  std::optional<Result> result;
  if (!take_finished(mesh, result)) result = run_anew(mesh);
  add(result);
  return result;
}

std::optional<Result> RunSequence::run_anew(const HighOrderMesh& mesh) {
  const bool resumes = std::exchange(restores_, false);
  if (resumes) {
    restored_.finished.clear();
    watch_ = Stopwatch::started(restored_.seconds);
    if (options_.time_limit > 0) stop_.stop_after(options_.time_limit - restored_.seconds);
  }
  begun_ = resumes ? restored_.begun : watch_.seconds();
  const double work_before = work_;
  if (resumes) work_ = restored_.work;

  Options options = options_;
  options.max_iterations -= static_cast<int>(history_.size());
  // 0 would mean no limit. With so little time left, the run ends before its first iteration.
  if (options.time_limit > 0) options.time_limit = std::max(1e-9, options_.time_limit - begun_);
  bool asked = false;
  const OnIteration pass_on = [&](const Iteration& own) {
    const Iteration iteration = numbered_through(own);
    if (own.number == 1) work_ = work_before;  // a checkpoint that cannot be used was ignored
    work_ += work_of(iteration);
    asked = on_iteration_ && on_iteration_(iteration) == Control::Stop;
    return asked || out_of_work() ? Control::Stop : Control::Continue;
  };
  RunControl control = control_of_run();
  if (resumes) control.checkpoint = under_way_;
  Expected<Result> result = optimise(mesh, options, pass_on, control);
  if (!result) return std::nullopt;
  if (resumes) resumed_from_ = static_cast<int>(history_.size()) + result->resumed_from;
  const bool cut_short = result->stopped && !asked && stop_.reason() != StopToken::Reason::Asked;
  if (cut_short) {
    result->stopped = false;
    result->stop_reason = StopReason::NoProgress;
  }
  stopped_ = stopped_ || result->stopped;
  for (Iteration& iteration : result->history) iteration = numbered_through(iteration);
  return std::move(*result);
}

Iteration RunSequence::numbered_through(Iteration iteration) const {
  iteration.number += static_cast<int>(history_.size());
  iteration.seconds += begun_;
  iteration.groups_left = groups_left_;
  return iteration;
}

void RunSequence::add(std::optional<Result>& result) {
  ++finished_runs_;
  if (asked_.checkpoint_due) kept_.finished.push_back(keep_result(result));
  if (result) history_.insert(history_.end(), result->history.begin(), result->history.end());
}

void RunSequence::finish(Result& result) {
  result.history = std::move(history_);
  result.iterations = static_cast<int>(result.history.size());
  result.resumed_from = resumed_from_;
  result.seconds = watch_.seconds();
  result.stopped = stopped_ || stop_.reason() == StopToken::Reason::Asked;
  if (result.stopped) {
    result.stop_reason = StopReason::Stopped;
  } else if (!result.after.uncertified.empty()) {  // without the limits, more would have been tried
    const bool is_over = options_.time_limit > 0 && result.seconds >= options_.time_limit;
    if (is_over || stop_.reason() == StopToken::Reason::TimeLimit) result.stop_reason = StopReason::TimeLimit;
    if (result.iterations >= options_.max_iterations) result.stop_reason = StopReason::Iterations;
  }
  // A run that the sequence has cut short was not ended by the caller's limit.
  if (result.stop_reason == StopReason::Iterations && result.iterations < options_.max_iterations)
    result.stop_reason = StopReason::NoProgress;
}

// ===== checkpoints =====

template <class Archive>
void RunSequence::Kept::state(Archive& archive) {
  std::uint64_t count = finished.size();
  archive(begun, seconds, work, count);
  for (std::uint64_t i = 0; i < count; ++i) {
    if constexpr (Archive::kReads) {
      if (archive.failed()) return;
      finished.emplace_back();
    }
    archive(finished[i]);
  }
}

RunControl RunSequence::control_of_run() {
  RunControl control = control_;
  if (!asked_.checkpoint_due) return control;
  // The run ends after the iteration that passes the allowed work. From its checkpoint it would go on.
  control.checkpoint_due = [this](const Iteration& own) {
    return work_ + work_of(own) < most_work_ && asked_.checkpoint_due(numbered_through(own));
  };
  control.save_checkpoint = [this](const Iteration& own, const WriteCheckpoint& write_run) {
    const Iteration iteration = numbered_through(own);
    kept_.begun = begun_;
    kept_.seconds = iteration.seconds;
    kept_.work = work_ + work_of(own);
    asked_.save_checkpoint(iteration, [&](const CheckpointSink& sink) { return write(sink, write_run); });
  };
  return control;
}

// A checkpoint is the number of the bytes of the next part; what the sequence keeps; the checkpoint of the run.

bool RunSequence::write(const CheckpointSink& sink, const WriteCheckpoint& write_run) {
  const auto write_kept = [&](const CheckpointSink& to) {
    CheckpointWriter writer(to, fingerprint_);
    kept_.state(writer);
    return writer.finish();
  };
  std::uint64_t size = 0;
  write_kept([&](std::string_view part) {
    size += part.size();
    return true;
  });
  return sink({reinterpret_cast<const char*>(&size), sizeof size}) && write_kept(sink) && write_run(sink);
}

bool RunSequence::read(std::string_view checkpoint) {
  std::uint64_t size = 0;
  if (checkpoint.size() < sizeof size) return false;
  std::memcpy(&size, checkpoint.data(), sizeof size);
  checkpoint.remove_prefix(sizeof size);
  if (size > checkpoint.size()) return false;
  CheckpointReader reader(checkpoint.substr(0, size), fingerprint_);
  restored_.state(reader);
  under_way_ = checkpoint.substr(size);
  return !reader.failed();
}

bool RunSequence::take_finished(const HighOrderMesh& mesh, std::optional<Result>& result) {
  const std::size_t next = finished_runs_;
  if (!restores_ || next >= restored_.finished.size()) return false;
  if (!take_kept(restored_.finished[next], mesh, result)) {
    restores_ = false;  // it is of another version: what follows begins anew
    return false;
  }
  if (result)
    for (const Iteration& iteration : result->history) work_ += work_of(iteration);
  return true;
}

}  // namespace varimesh
