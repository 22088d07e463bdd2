// The steps of an attempt: open the mesh, run the engine, store the results.
#include "server/scheduling/attempt.h"

#include <atomic>
#include <exception>
#include <memory>
#include <new>
#include <optional>
#include <utility>

#include "core/base/utf8.h"
#include "server/engine/translate.h"
#include "server/jobs/timestamps.h"
#include "server/scheduling/outputs.h"
#include "server/scheduling/run_device.h"
#include "server/scheduling/run_memory.h"

namespace varimesh::server {
namespace {

Ending failed(const Error& error) {
  Ending ending;
  ending.state = v1::JOB_STATE_FAILED;
  ending.error = to_proto(error);
  return ending;
}

Ending failed(const Failure& failure) {
  return failed(Error{failure.code == Failure::Code::ResourceExhausted ? Error::Kind::Output : Error::Kind::Internal,
                      failure.sentence});
}

/// The store has not taken what a run leaves. If it may do so later, the run goes on from its checkpoint then, after a
/// pause: the disk would be as full at once.
Ending not_stored(Room& room, const Failure& failure) {
  if (!Room::may_pass(failure)) return failed(failure);
  room.wait();
  Ending ending;
  ending.state = v1::JOB_STATE_PENDING;
  return ending;
}

/// The job has no result: it was cancelled, or the next server continues it.
Ending unfinished(const Attempt& attempt) {
  Ending ending;
  ending.state = attempt.cancelled() ? v1::JOB_STATE_CANCELLED : v1::JOB_STATE_PENDING;
  return ending;
}

/// Adds every iteration to the event log, and reports one every half second to the store.
class Progress {
 public:
  explicit Progress(const Attempt& attempt) : attempt_(attempt) {}

  void operator()(const Iteration& iteration) {
    const SteadyTime now = attempt_.steady();
    v1::JobEvent event = event_at(attempt_.clock());
    *event.mutable_iteration() = to_proto(iteration);
    if (!noted_ || now - *noted_ >= std::chrono::milliseconds(500)) {
      noted_ = now;
      attempt_.note_progress(event.iteration());
    }
    attempt_.log.append(std::move(event));
  }

  void note(const v1::SlideTrial& trial) {
    v1::JobEvent event = event_at(attempt_.clock());
    *event.mutable_slide_trial() = trial;
    attempt_.log.append(std::move(event));
  }

  void note(const std::string& sentence) {
    v1::JobEvent event = event_at(attempt_.clock());
    event.mutable_log()->set_text(as_plain_text(sentence));
    attempt_.log.append(std::move(event));
  }

 private:
  v1::JobEvent event_at(TimePoint time) const {
    v1::JobEvent event;
    event.set_attempt(attempt_.claim.attempt);
    *event.mutable_time() = timestamp(time);
    return event;
  }

  const Attempt& attempt_;
  std::optional<SteadyTime> noted_;
};

/// Tells which stage the attempt is in.
class Stages {
 public:
  explicit Stages(const Attempt& attempt) : attempt_(attempt) { enter("fetch"); }

  void enter(const char* stage) {
    last_ = attempt_.clock();
    attempt_.on_stage(stage, last_);
  }
  /// The mesh has been read, and the optimisation begins.
  void begin_phases() { last_ = attempt_.clock(); }
  /// An iteration has ended, which began where the one before it ended.
  void note(Phase phase) {
    constexpr const char* kNames[] = {"sweeps", "newton", "untangle", "accuracy"};
    attempt_.on_stage(kNames[static_cast<std::size_t>(phase)], last_);
    last_ = attempt_.clock();
  }

 private:
  const Attempt& attempt_;
  TimePoint last_{};
};

/// Decides when a checkpoint is due and puts it into the mesh store. A checkpoint that cannot be written is skipped;
/// the job continues, and its previous checkpoint stays valid.
class Checkpoints {
 public:
  explicit Checkpoints(const Attempt& attempt) : attempt_(attempt), saved_(attempt.steady()), asked_(saved_) {
    if (attempt.claim.checkpoint) iteration_ = attempt.claim.checkpoint->iteration;
  }

  bool due(int iteration) {
    if (attempt_.note_checkpoint == nullptr || iteration == iteration_) return false;
    const SteadyTime now = attempt_.steady();
    const auto since = now - saved_, took = now - std::exchange(asked_, now);
    // Small meshes take only a moment for ten iterations, and a checkpoint waits for the disk. If iterations are so
    // long that a server that stops may not wait for the end of one, each is saved.
    const bool often_enough = since < kInterval && took < kLong &&
                              (iteration - iteration_ < kIterations || since < attempt_.checkpoint_pause);
    return !often_enough || attempt_.stopping();
  }

  /// Whether the next attempt would continue after this iteration.
  bool has_saved(int iteration) const { return iteration == iteration_; }

  void save(int iteration, const WriteCheckpoint& write) {
    auto writer = attempt_.meshes.create();
    if (!writer || !write([&](std::string_view bytes) { return (*writer)->append(bytes); })) return;
    const auto stored = (*writer)->commit();
    if (!stored) return;
    // If it could not be recorded, another one is tried as soon as it would be due after this one.
    saved_ = attempt_.steady();
    if (attempt_.note_checkpoint({stored->digest, iteration})) iteration_ = iteration;
  }

 private:
  static constexpr int kIterations = 10;
  static constexpr std::chrono::seconds kInterval{30};
  static constexpr std::chrono::seconds kLong{5};  ///< For an iteration: half of what a server waits that stops.

  const Attempt& attempt_;
  SteadyTime saved_, asked_;
  int iteration_ = 0;
};

/// Whether a run has to stop at once. If the server stops, the run may first reach the next iteration that can be saved
/// as a checkpoint: otherwise half a minute of work may be lost, or all of it. May be called by several threads at the
/// same time.
class StopAtOnce {
 public:
  explicit StopAtOnce(const Attempt& attempt) : attempt_(attempt) {}

  bool operator()() {
    if (attempt_.cancelled()) return true;
    if (!attempt_.stopping()) return false;
    const SteadyTime now = attempt_.steady();
    SteadyTime first{};
    if (stopping_since_.compare_exchange_strong(first, now)) first = now;
    return now - first >= attempt_.stop_patience();
  }

 private:
  const Attempt& attempt_;
  std::atomic<SteadyTime> stopping_since_ = SteadyTime{};
};

/// Tells what the kernels of an attempt have done, however it ends.
class KernelReport {
 public:
  KernelReport(const Attempt& attempt, const WorkMeter& meter) : attempt_(attempt), meter_(meter) {}
  ~KernelReport() { tell(); }
  KernelReport(const KernelReport&) = delete;
  KernelReport& operator=(const KernelReport&) = delete;

  void tell() {
    const KernelWork now = meter_.kernels();
    attempt_.kernels_worked({now.operations - told_.operations, now.seconds - told_.seconds});
    told_ = now;
  }

 private:
  const Attempt& attempt_;
  const WorkMeter& meter_;
  KernelWork told_;
};

RunRequest request_of(const Attempt& attempt, std::shared_ptr<const Blob> input, const Options& options) {
  const v1::JobSpec& spec = attempt.claim.spec;
  RunRequest request;
  request.input = std::move(input);
  request.format = spec.mesh().format();
  request.options = options;
  request.options.threads = attempt.threads.now();
  if (spec.has_quality()) request.quality = spec.quality();
  if (spec.has_geometry()) request.geometry = spec.geometry();
  if (spec.has_layers()) request.layers = spec.layers();
  request.keep_orders = spec.keep_orders();
  for (const int format : spec.outputs()) request.outputs.push_back(static_cast<v1::MeshFormat>(format));
  return request;
}

/// Opens the mesh or the CAD file of the job; null if it has none.
Answer<std::shared_ptr<const Blob>> open_input(const Attempt& attempt, Room& room, const std::string& digest) {
  if (digest.empty()) return std::shared_ptr<const Blob>();
  return room.await([&] { return attempt.meshes.open(digest); });
}

/// Returns the state that an earlier attempt has saved; null if there is none.
std::shared_ptr<const Blob> saved_state(const Attempt& attempt) {
  if (!attempt.claim.checkpoint) return nullptr;
  // Without it the run starts from the beginning, which costs nothing but time.
  auto blob = attempt.meshes.open(attempt.claim.checkpoint->digest);
  return blob ? std::move(*blob) : nullptr;
}

/// Takes the device of the run, if the job asks for one that the run can use. False if the attempt is to end.
bool take_device(const Attempt& attempt, const Options& options, Progress& progress, DeviceForRun& device) {
  return device.take(
      device_asked_for(attempt.claim.spec, options, attempt.engine), attempt.claim.lost > 0, attempt.threads,
      [&] { return attempt.cancelled() || attempt.stopping(); },
      [&](const std::string& sentence) { progress.note(sentence); });
}

/// The run of an attempt by the engine.
class EngineRun {
 public:
  EngineRun(const Attempt& attempt, Progress& progress, Room& room)
      : attempt_(attempt), progress_(progress), room_(room), stages_(attempt) {}

  Ending run() {
    const v1::JobSpec& spec = attempt_.claim.spec;
    auto input = open_input(attempt_, room_, spec.mesh().digest());
    if (!input) return failed(input.error());
    auto cad_file = open_input(attempt_, room_, spec.geometry().digest());
    if (!cad_file) return failed(cad_file.error());
    const auto options = options_from(spec.options());
    if (!options) return failed(Error{Error::Kind::BadOption, options.error().sentence});
    const std::shared_ptr<const Blob> checkpoint = saved_state(attempt_);
    if (!take_device(attempt_, *options, progress_, device_)) return unfinished(attempt_);
    stages_.enter("read");
    checkpoints_.emplace(attempt_);

    RunHooks hooks;
    add_progress(hooks);
    add_stops(hooks);
    add_resources(hooks);
    if (checkpoint != nullptr) hooks.control.checkpoint = checkpoint->bytes();
    RunRequest request = request_of(attempt_, std::move(*input), *options);
    request.cad_file = std::move(*cad_file);
    device_.tell(request);
    auto outcome = attempt_.engine.run(std::move(request), hooks);
    device_.give_back();
    if (outputs_.failure()) return not_stored(room_, *outputs_.failure());
    if (!outcome) return failed(outcome.error());
    if (auto ending = without_results(*outcome)) return std::move(*ending);
    return with_results(*outcome, *options);
  }

 private:
  /// The server stops, and the next one continues the job.
  bool given_up() const { return attempt_.stopping() && !attempt_.cancelled(); }

  void add_progress(RunHooks& hooks) {
    hooks.on_work = [this](const v1::Work& work) { attempt_.log.set_work(work); };
    hooks.control.meter = &meter_;
    hooks.mesh_watched = [this] { return attempt_.log.is_mesh_watched(); };
    hooks.show_mesh = [this](std::string bytes) {
      attempt_.log.show_mesh(std::make_shared<const std::string>(std::move(bytes)));
    };
    hooks.on_note = [this](const std::string& sentence) { progress_.note(sentence); };
    hooks.on_slide_trial = [this](const v1::SlideTrial& trial) { progress_.note(trial); };
  }

  void add_stops(RunHooks& hooks) {
    const bool can_be_saved = attempt_.note_checkpoint != nullptr;
    hooks.on_iteration = [this, can_be_saved](const Iteration& iteration) {
      progress_(iteration);
      kernels_.tell();
      stages_.note(iteration.phase);
      const bool is_safe = !can_be_saved || checkpoints_->has_saved(iteration.number);
      return attempt_.cancelled() || (attempt_.stopping() && (is_safe || stop_at_once_())) ? Control::Stop
                                                                                           : Control::Continue;
    };
    hooks.control.stop_asked = [this, can_be_saved] {
      return stop_at_once_() || (!can_be_saved && attempt_.stopping());
    };
    hooks.control.checkpoint_due = [this](const Iteration& iteration) { return checkpoints_->due(iteration.number); };
    hooks.control.save_checkpoint = [this](const Iteration& iteration, const WriteCheckpoint& write) {
      checkpoints_->save(iteration.number, write);
    };
    hooks.given_up = [this] { return given_up(); };
  }

  void add_resources(RunHooks& hooks) {
    hooks.control.threads = attempt_.threads.now;
    hooks.admit_reading = [this](std::int64_t least, std::int64_t most) {
      return memory_.take_for_reading(least, most);
    };
    hooks.admit = [this](std::int64_t bytes) {
      auto admitted = memory_.take(bytes);
      stages_.begin_phases();
      return admitted;
    };
    hooks.control.spare_memory = memory_.spare();
    hooks.device_unused = [this] { device_.give_back(); };
    hooks.open_output = [this](v1::MeshFormat format) {
      stages_.enter("store");
      return outputs_.open(format);
    };
  }

  /// The ending of a run whose results are not kept.
  std::optional<Ending> without_results(const RunOutcome& outcome) const {
    Ending ending;
    ending.state = v1::JOB_STATE_PENDING;
    if (!outcome.lost.empty()) {
      ending.lost = outcome.lost;
      return ending;
    }
    if (outcome.stopped && given_up()) return ending;
    if (!outcome.unwritten) return std::nullopt;
    if (attempt_.cancelled())
      ending.state = v1::JOB_STATE_CANCELLED;
    else
      ending.lost = "ended before its results were written";
    return ending;
  }

  Ending with_results(RunOutcome& outcome, const Options& options) {
    outputs_.close();
    if (outputs_.failure()) return not_stored(room_, *outputs_.failure());
    const auto history = store_history(attempt_.meshes, room_, outcome.history);
    if (!history) return not_stored(room_, history.error());
    Ending ending;
    // The result of a cancelled job is the best mesh so far.
    ending.state = outcome.stopped || attempt_.cancelled() ? v1::JOB_STATE_CANCELLED : v1::JOB_STATE_SUCCEEDED;
    ending.metrics = std::move(outcome.metrics);
    device_.tell(*ending.metrics);
    add_options(options, *ending.metrics);
    ending.history_digest = *history;
    ending.results = outputs_.take();
    return ending;
  }

  const Attempt& attempt_;
  Progress& progress_;
  Room& room_;
  Stages stages_;
  DeviceForRun device_{attempt_.devices};
  std::optional<Checkpoints> checkpoints_;  ///< From the time on when nothing is waited for any more.
  Outputs outputs_{attempt_.meshes, room_};
  RunMemory memory_{attempt_.memory, attempt_.claim.owner, attempt_.threads,
                    [this] { return attempt_.cancelled() || attempt_.stopping(); }};
  WorkMeter meter_{[this](const Work& work) { attempt_.log.set_work(to_proto(work)); }};
  KernelReport kernels_{attempt_, meter_};
  StopAtOnce stop_at_once_{attempt_};
};

}  // namespace

Ending run_attempt(const Attempt& attempt) {
  try {
    Progress progress(attempt);
    Room room(
        attempt.store_pause, [&] { return attempt.cancelled() || attempt.stopping(); },
        [&] {
          progress.note("The server's disk is full; the job waits for room.");
          attempt.waits_for_room();
        });
    const Ending ending = EngineRun(attempt, progress, room).run();
    attempt.log.show_mesh(nullptr);
    if (!room.gave_up()) return ending;
    // There is no room for what the run has made, and a cancel does not wait for it.
    return unfinished(attempt);
  } catch (const std::bad_alloc&) {
    return failed(
        Error{Error::Kind::Internal,
              "There was not enough memory for this mesh; use a machine with more memory, or a smaller mesh."});
  } catch (const std::exception& error) {
    return failed(Error{Error::Kind::Internal,
                        std::string("The run ended unexpectedly (") + error.what() + "); please report it."});
  }
}

}  // namespace varimesh::server
