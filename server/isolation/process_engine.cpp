// The server's side of the conversation with the process of a job. It runs on the job's thread, which sleeps while the
// process computes.
#include "server/isolation/process_engine.h"

#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "core/base/utf8.h"
#include "core/formats/formats.h"
#include "core/geometry/load.h"
#include "core/optimise/device/device_choice.h"
#include "core/process/driver_rules.h"
#include "core/process/helper_program.h"
#include "core/threads/crew.h"
#include "server/engine/geometry_messages.h"
#include "server/engine/models/draw_model.h"
#include "server/engine/translate.h"
#include "server/isolation/hdf5_programs.h"
#include "server/isolation/loan.h"
#include "server/isolation/messages.h"
#include "server/isolation/plain_texts.h"
#include "server/isolation/reported_work.h"
#include "server/isolation/said.h"
#include "server/isolation/thread_watch.h"
#include "server/isolation/worker.pb.h"
#include "server/isolation/worker_process.h"

namespace varimesh::server {
namespace {

using std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

/// How often the server looks whether the run is to stop. The process is told at once.
constexpr int kMillisecondsBetweenLooks = 20;
/// Address space beside what the run needs: the program's own structures, and what is lost between them.
constexpr std::int64_t kSpareBytes = std::int64_t{512} << 20;
/// Address space that a thread takes before it uses any: its stack, and the heap that the system's library reserves.
constexpr std::int64_t kBytesPerThread = std::int64_t{144} << 20;
/// How much longer it may take if there is a CAD file to read.
constexpr double kSecondsForGeometry = 600;
constexpr int kMostNotes = 100;

/// One run in a process.
class Conversation {
 public:
  Conversation(const ProcessEngineSettings& settings, Workers& workers, ThreadWatch& watch, RunRequest request,
               const RunHooks& hooks)
      : settings_(settings),
        workers_(workers),
        watch_(watch),
        request_(std::move(request)),
        hooks_(hooks),
        mesh_bytes_(static_cast<std::int64_t>(request_.input->bytes().size())),
        checkpoint_bytes_(static_cast<std::int64_t>(hooks.control.checkpoint.size())),
        process_(workers.take()),
        id_(process_->id()),
        said_(std::max(1, static_cast<int>(request_.outputs.size()))),
        hdf5_(watch) {
    settings_.started(static_cast<int>(id_));
    const std::int64_t shared = mesh_bytes_ + checkpoint_bytes_ + kDriverSharedBytes;
    request_.device.empty() ? watch_.add(id_, most_threads())
                            : watch_.add(id_, most_threads() + kDriverThreads, shared);
  }
  ~Conversation() { watch_.forget(id_); }
  Conversation(const Conversation&) = delete;
  Conversation& operator=(const Conversation&) = delete;

  Expected<RunOutcome> run() {
    send_request();
    request_.input.reset();  // the process has its own copy
    workers_.prepare();
    while (!outcome_) take(next());
    return std::move(*outcome_);
  }

 private:
  void send_request() {
    worker::ToWorker message;
    worker::Request& request = *message.mutable_request();
    request = message_of(request_);
    request.set_draws_model(has_cad_file_ && !request_.geometry);
    request.set_mesh_bytes(mesh_bytes_);
    request.set_checkpoint_bytes(checkpoint_bytes_);
    request.set_has_hdf5(formats::has_hdf5());
    if (request_.options.time_limit > 0)
      request.set_processor_seconds(static_cast<std::int64_t>(std::min(1e12, most_seconds() * most_threads())));
    const Descriptor mesh(open_read_only(*request_.input));
    if (mesh.number < 0) throw ProcessLost{"could not get its mesh"};
    send(message, mesh.number);
    send_geometry();
    if (checkpoint_bytes_ == 0) return;
    const Descriptor checkpoint(sealed_copy(hooks_.control.checkpoint));
    if (checkpoint.number < 0) throw ProcessLost{"could not get its checkpoint"};
    message.mutable_checkpoint();
    send(message, checkpoint.number);
  }

  void send_geometry() {
    if (request_.cad_file == nullptr) return;
    worker::ToWorker message;
    const auto bytes = static_cast<std::int64_t>(request_.cad_file->bytes().size());
    message.mutable_geometry()->set_plugin(settings_.cad_plugin);
    message.mutable_geometry()->set_most_memory(geometry::memory_for_reading(bytes));
    const Descriptor file(open_read_only(*request_.cad_file));
    if (file.number < 0) throw ProcessLost{"could not get its geometry"};
    send(message, file.number);
    request_.cad_file.reset();
  }

  int most_threads() const { return std::max({machine_threads(), settings_.threads, request_.options.threads}); }

  /// Wall time, in seconds.
  double most_seconds() const {
    return 2 * request_.options.time_limit + static_cast<double>(said_.patience().count()) +
           (has_cad_file_ ? kSecondsForGeometry : 0);
  }

  /// A process that has ended hears nothing, but what it said before counts.
  void send(const worker::ToWorker& message, int file = -1) {
    if (process_->channel().send(message, file) || process_->channel().is_closed()) return;
    fail_ended();
  }
  [[noreturn]] void fail_ended() {
    if (const char* const why = watch_.why_killed(id_)) throw ProcessLost{why};
    process_->fail_ended();
  }

  // === What the process is told all the time ===

  worker::Steering steering() const { return steering_by(hooks_, request_.options.threads, full_); }

  void steer() {
    worker::ToWorker message;
    *message.mutable_steering() = steering();
    if (message.steering().stop() && !stopping_since_) said_.hear(*(stopping_since_ = steady_clock::now()));
    std::string told = message.steering().SerializeAsString();
    if (std::exchange(told_, std::move(told)) != message.steering().SerializeAsString()) send(message);
  }

  /// Ends a process that takes longer than the library ever does, or than a driver may.
  void check_time() const {
    const steady_clock::time_point now = steady_clock::now();
    const Seconds to_begin = kPatience + Seconds(has_cad_file_ ? kSecondsForGeometry : 0);
    if (!request_.device.empty() && !has_started_ && now - began_ > to_begin)
      throw ProcessLost{"did not open its device in time"};
    if (request_.options.time_limit > 0 && Seconds(now - began_).count() > most_seconds())
      throw ProcessLost{"did not end within " + std::to_string(static_cast<std::int64_t>(most_seconds())) +
                        " s, with a time limit of " +
                        std::to_string(static_cast<std::int64_t>(request_.options.time_limit)) + " s"};
    if (stopping_since_ && now - *stopping_since_ > (said_.is_silent(now) ? kPatience : said_.patience()))
      throw ProcessLost{"did not stop when it was told to"};
  }

  // === What the process says ===

  const worker::FromWorker& next() {
    while (true) {
      steer();
      check_time();
      const auto has_few_parts = [](std::string_view bytes) { return parts_of(bytes).has_value(); };
      switch (process_->channel().receive(message_, kMillisecondsBetweenLooks, has_few_parts)) {
        case Channel::Got::Message:
          said_.check(message_);
          return message_;
        case Channel::Got::Nothing:
          break;
        case Channel::Got::End:
          fail_ended();
        case Channel::Got::Breach:
          throw ProcessLost{"sent what is no message"};
      }
    }
  }

  void take(const worker::FromWorker& message) {
    switch (message.kind_case()) {
      case worker::FromWorker::kStarted:
        return note_start(message.started());
      case worker::FromWorker::kIteration:
        return answer(hooks_.on_iteration && hooks_.on_iteration(iteration_from(message.iteration())) == Control::Stop);
      case worker::FromWorker::kCheckpointDue:
        return answer(hooks_.control.checkpoint_due &&
                      hooks_.control.checkpoint_due(iteration_from(message.checkpoint_due())));
      case worker::FromWorker::kCheckpoint:
        return save_checkpoint(iteration_from(message.checkpoint()));
      case worker::FromWorker::kWork:
        return hooks_.on_work ? hooks_.on_work(message.work()) : void();
      case worker::FromWorker::kKernels:
        return add_reported(message.kernels(), began_, most_threads(), hooks_.control.meter);
      case worker::FromWorker::kNote:
        if (hooks_.on_note && notes_++ < kMostNotes) hooks_.on_note(as_plain_text(message.note()));
        return;
      case worker::FromWorker::kSlideTrial:
        return tell_trial(message.slide_trial());
      case worker::FromWorker::kShownMesh:
        if (hooks_.show_mesh && steering().watched()) hooks_.show_mesh(message.shown_mesh());
        return;
      case worker::FromWorker::kReading:
        return admit_reading(message.reading().least(), message.reading().most());
      case worker::FromWorker::kRunning:
        return admit(message.running().most());
      case worker::FromWorker::kSpare:
        return lend(message.spare());
      case worker::FromWorker::kSpareBack:
        return loan_.take_back(hooks_.control.spare_memory, message.spare_back());
      case worker::FromWorker::kOutput:
        return store([&] { output_ = hooks_.open_output(message.output()); });
      case worker::FromWorker::kOutputPiece:
        return store([&] { full_ = full_ || output_ == nullptr || !output_(message.output_piece()); });
      case worker::FromWorker::kHdf5:
        return start_hdf5(message.hdf5());
      case worker::FromWorker::kDeviceUnused:
        return give_device_back();
      case worker::FromWorker::kHistory:
        return history_.MergeFrom(message.history());
      case worker::FromWorker::kFailure:
        outcome_ = tl::unexpected(plain_error(message.failure()));
        return;
      case worker::FromWorker::kEnded:
        return end(message.ended());
      case worker::FromWorker::kCheckpointPiece:
      case worker::FromWorker::KIND_NOT_SET:
        throw ProcessLost{"sent a message that nobody expects"};
    }
  }

  /// The time in which the store takes what the run has written is not the run's: a full disk is waited for.
  void store(const std::function<void()>& work) {
    const steady_clock::time_point before = steady_clock::now();
    work();
    const steady_clock::duration took = steady_clock::now() - before;
    began_ += took;
    if (stopping_since_) *stopping_since_ += took;
  }

  void tell_trial(v1::SlideTrial trial) {
    make_plain(trial);
    if (hooks_.on_slide_trial && notes_++ < kMostNotes) hooks_.on_slide_trial(trial);
  }

  void end(const worker::Ended& ended) {
    RunOutcome& outcome = *outcome_.emplace();
    outcome.stopped = ended.stopped();
    outcome.unwritten = ended.unwritten();
    outcome.metrics = ended.metrics();
    make_plain(outcome.metrics);
    outcome.history = std::move(history_);
  }

  void answer(worker::ToWorker message, int file = -1) {
    *message.mutable_answer()->mutable_steering() = steering();
    send(message, file);
  }
  void answer(const Expected<bool>& outcome) { answer(answer_of(outcome)); }

  // === Questions ===

  void note_start(const worker::Started& started) {
    has_started_ = true;
    process_->set_device(started.has_device());
    if (!started.has_device()) give_device_back();
    address_space_ = started.address_space() + mesh_bytes_ + checkpoint_bytes_;
    static std::atomic<bool> warned = false;
    if (!started.is_filtered() && !warned.exchange(true))
      settings_.warn(
          "this system has no seccomp filters: the processes of jobs have limits of memory, time and descriptors, but "
          "can use the files of this user");
  }

  void give_device_back() const {
    if (!request_.device.empty() && hooks_.device_unused) hooks_.device_unused();
  }

  /// The address space of a run that takes `bytes`.
  std::int64_t address_space_for(std::int64_t bytes) const {
    // Beside those that compute there are two: the first, and the one that listens to the server.
    const auto threads = static_cast<std::int64_t>(most_threads()) + 2;
    return address_space_ + bytes + kSpareBytes + threads * kBytesPerThread;
  }

  void admit_reading(std::int64_t least, std::int64_t most) {
    const Expected<bool> admitted = hooks_.admit_reading ? hooks_.admit_reading(least, most) : Expected<bool>(true);
    if (admitted && *admitted) process_->limit_memory(address_space_for(most));
    begin();
    answer(admitted);
  }

  void admit(std::int64_t bytes) {
    const Expected<bool> admitted = hooks_.admit ? hooks_.admit(bytes) : Expected<bool>(true);
    if (admitted && *admitted) {
      // The need is an estimate, which can be too low by a twentieth, and memory is lost between the pieces in use.
      loan_.begin(*process_, address_space_for(2 * bytes));
      said_.admit(bytes);
    }
    begin();
    answer(admitted);
  }

  void lend(std::int64_t bytes) {
    worker::ToWorker message;
    message.mutable_answer()->set_lent(loan_.lend(*process_, hooks_.control.spare_memory, bytes));
    answer(std::move(message));
  }

  /// The time that a run waits for memory is not its own.
  void begin() { said_.hear(began_ = steady_clock::now()); }

  void save_checkpoint(const Iteration& iteration) {
    bool ended = false;
    const auto piece = [&]() -> const std::string& {
      const worker::FromWorker& message = next();
      if (message.kind_case() != worker::FromWorker::kCheckpointPiece && !message.has_work())
        throw ProcessLost{"sent a message that nobody expects"};
      ended = message.kind_case() == worker::FromWorker::kCheckpointPiece && message.checkpoint_piece().empty();
      return message.checkpoint_piece();
    };
    const auto write = [&](const CheckpointSink& sink) {
      bool wanted = true;
      while (!ended)
        if (const std::string& bytes = piece(); !bytes.empty() && wanted) wanted = sink(bytes);
      return wanted;
    };
    if (hooks_.control.save_checkpoint) hooks_.control.save_checkpoint(iteration, write);
    while (!ended) piece();
  }

  void start_hdf5(const worker::StartHdf5& start) {
    const auto program = hdf5_.start({start.writes(), start.seconds(), start.memory()}, most_threads());
    worker::ToWorker message;
    message.mutable_answer()->set_error(program.error);
    answer(std::move(message), program.socket);
    if (program.socket >= 0) ::close(program.socket);
  }

  const ProcessEngineSettings& settings_;
  Workers& workers_;
  ThreadWatch& watch_;
  RunRequest request_;
  const RunHooks& hooks_;
  const std::int64_t mesh_bytes_, checkpoint_bytes_;
  const bool has_cad_file_ = request_.cad_file != nullptr;
  std::unique_ptr<WorkerProcess> process_;
  const pid_t id_;
  Said said_;
  worker::FromWorker message_;
  std::int64_t address_space_ = 0;  ///< Of the process before it reads the mesh, in bytes, with the mesh.
  Loan loan_;
  std::string told_;  ///< The steering that the process was told last.
  Sink output_;
  bool full_ = false;
  int notes_ = 0;
  bool has_started_ = false;
  v1::History history_;
  Hdf5Programs hdf5_;
  steady_clock::time_point began_ = steady_clock::now();  ///< Since when the run has its memory.
  std::optional<steady_clock::time_point> stopping_since_;
  std::optional<Expected<RunOutcome>> outcome_;
};

}  // namespace

std::string find_worker() { return find_helper("varimesh_worker", "VARIMESH_WORKER"); }
std::string find_cad_plugin() { return geometry::plugin_path(); }

Engine process_engine(ProcessEngineSettings settings) {
  Engine engine = core_engine();
  engine.check_geometry = [plugin = settings.cad_plugin](const v1::Geometry& geometry,
                                                         const Options& options) -> Expected<void> {
    return plugin.empty() && !is_on_boundary(geometry) ? has_no_plugin() : check(geometry, options);
  };
  engine.uses_device = may_take_device;
  const auto workers = std::make_shared<Workers>(settings.program);
  const auto watch = std::make_shared<ThreadWatch>();
  engine.run = [settings = std::move(settings), workers, watch](RunRequest request,
                                                                const RunHooks& hooks) -> Expected<RunOutcome> {
    // A server that shares its jobs with others may have the plugin when this one has not.
    if (request.cad_file != nullptr && settings.cad_plugin.empty()) return has_no_plugin();
    if (!settings.cad_plugin.empty() && wants_picture(request)) request.cad_file = request.input;
    try {
      return Conversation(settings, *workers, *watch, std::move(request), hooks).run();
    } catch (const ProcessLost& lost) {
      RunOutcome outcome;
      outcome.lost = lost.why;
      return outcome;
    }
  };
  return engine;
}

}  // namespace varimesh::server
