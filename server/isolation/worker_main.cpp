// varimesh_worker: runs one job in a process of its own, so that a mesh which makes the library crash, hang or fill the
// memory ends only this process. process_engine.cpp starts it and tells it what to do (worker.proto).
//
// Descriptor 3 is the socket to the server. The first messages bring the open files of the mesh and, if there is one,
// of the checkpoint of an earlier attempt. Before the first byte of the mesh is read, the process gives up everything
// that it does not need (core/process/sandbox.h).
#include <sys/mman.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <cstdint>
#include <exception>
#include <fstream>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "core/base/machine_memory.h"
#include "core/base/utf8.h"
#include "core/formats/hdf5/starter.h"
#include "core/geometry/load.h"
#include "core/process/sandbox.h"
#include "server/engine/engine.h"
#include "server/engine/geometry_messages.h"
#include "server/engine/models/draw_model.h"
#include "server/engine/option_messages.h"
#include "server/engine/translate.h"
#include "server/isolation/channel.h"
#include "server/isolation/mapped_file.h"
#include "server/isolation/socket_of_worker.h"
#include "server/isolation/worker.pb.h"

// Highway measures a clock for 7 ms when it is loaded, for benchmarks that nobody runs here.
namespace hwy::platform {
std::uint64_t TimerResolution();
std::uint64_t TimerResolution() { return 1; }
}  // namespace hwy::platform

namespace varimesh::server {
namespace {

/// Pieces of an output that go out together, in bytes.
constexpr std::size_t kPieceBytes = std::size_t{512} << 10;
/// What a process takes, mostly reserved for threads, before the server knows what its run needs.
constexpr std::int64_t kBytesBeforeReading = std::int64_t{1} << 30;
/// Iterations in one message of the history.
constexpr int kIterationsPerPart = 10'000;

/// This process's side of the conversation. Its thread takes what the server says.
class Conversation {
 public:
  explicit Conversation(Channel& channel) : channel_(channel) {}

  /// Starts the thread, which lives as long as the process.
  void listen() {
    std::thread([this] { take_all(); }).detach();
  }
  void say(const worker::FromWorker& message) {
    if (!channel_.send(message)) ::_exit(1);  // the server is gone
  }
  /// Asks and waits for the answer. `answered` gets the descriptor that comes back, or −1.
  worker::Answer ask(const worker::FromWorker& question, int* answered = nullptr) {
    const std::scoped_lock one(asking_);
    std::unique_lock lock(mutex_);
    answer_.reset();
    if (!channel_.send(question)) ::_exit(1);
    came_.wait(lock, [this] { return answer_.has_value(); });
    if (answered != nullptr) *answered = std::exchange(file_, -1);
    return std::move(*answer_);
  }

  int threads() const { return threads_; }
  bool stops() const { return stop_.load(std::memory_order_relaxed); }
  bool given_up() const { return given_up_; }
  bool full() const { return full_; }
  bool watched() const { return watched_; }

 private:
  void take_all() {
    worker::ToWorker message;
    while (channel_.receive(message, -1) == Channel::Got::Message) {
      if (message.has_steering()) steer(message.steering());
      if (!message.has_answer()) continue;
      steer(message.answer().steering());
      const std::scoped_lock lock(mutex_);
      file_ = channel_.take_file();
      answer_ = std::move(*message.mutable_answer());
      came_.notify_all();
    }
    ::_exit(1);
  }
  void steer(const worker::Steering& steering) {
    threads_ = std::max(1, steering.threads());
    given_up_ = steering.given_up();
    full_ = steering.full();
    watched_ = steering.watched();
    stop_ = steering.stop();
  }

  Channel& channel_;
  std::mutex asking_, mutex_;
  std::condition_variable came_;
  std::optional<worker::Answer> answer_;
  int file_ = -1;
  std::atomic<int> threads_ = 1;
  std::atomic<bool> stop_ = false, given_up_ = false, full_ = false, watched_ = false;
};

/// Collects the pieces of an output.
class Output {
 public:
  explicit Output(Conversation& server) : server_(server) {}

  bool add(std::string_view bytes) {
    piece_ += bytes;
    while (piece_.size() >= kPieceBytes) {
      send(piece_.substr(0, kPieceBytes));
      piece_.erase(0, kPieceBytes);
    }
    return !server_.full();
  }
  void end() {
    if (!piece_.empty()) send(std::exchange(piece_, {}));
  }

 private:
  void send(std::string bytes) {
    worker::FromWorker message;
    message.set_output_piece(std::move(bytes));
    server_.say(message);
  }

  Conversation& server_;
  std::string piece_;
};

Expected<bool> outcome_of(const worker::Answer& answer) {
  if (!answer.has_failure()) return answer.yes();
  return tl::unexpected(Error{static_cast<Error::Kind>(answer.failure().kind()), answer.failure().sentence()});
}

/// Tells the server what the kernels have done since it was told last.
void tell_kernels(Conversation& server, const WorkMeter& meter, KernelWork& told) {
  const KernelWork now = meter.kernels();
  worker::FromWorker message;
  message.mutable_kernels()->set_operations(now.operations - told.operations);
  message.mutable_kernels()->set_seconds(now.seconds - told.seconds);
  told = now;
  server.say(message);
}

/// What the library asks, as questions to the server.
RunHooks hooks_for(Conversation& server, Output& output, WorkMeter& meter, KernelWork& told,
                   std::atomic<bool>& is_read) {
  RunHooks hooks;
  hooks.on_iteration = [&](const Iteration& iteration) {
    tell_kernels(server, meter, told);
    worker::FromWorker question;
    *question.mutable_iteration() = to_proto(iteration);
    return server.ask(question).yes() ? Control::Stop : Control::Continue;
  };
  hooks.on_note = [&](const std::string& sentence) {
    worker::FromWorker message;
    message.set_note(as_plain_text(sentence));
    server.say(message);
  };
  hooks.on_slide_trial = [&](const v1::SlideTrial& trial) {
    worker::FromWorker message;
    *message.mutable_slide_trial() = trial;
    server.say(message);
  };
  hooks.mesh_watched = [&] { return server.watched(); };
  hooks.show_mesh = [&](std::string bytes) {
    worker::FromWorker message;
    message.set_shown_mesh(std::move(bytes));
    server.say(message);
  };
  hooks.control.meter = &meter;
  hooks.control.stop_asked = [&] { return server.stops(); };
  hooks.control.threads = [&] { return server.threads(); };
  hooks.control.checkpoint_due = [&](const Iteration& iteration) {
    worker::FromWorker question;
    *question.mutable_checkpoint_due() = to_proto(iteration);
    return server.ask(question).yes();
  };
  hooks.control.save_checkpoint = [&](const Iteration& iteration, const WriteCheckpoint& write) {
    worker::FromWorker message;
    *message.mutable_checkpoint() = to_proto(iteration);
    server.say(message);
    write([&](std::string_view bytes) {
      for (; !bytes.empty(); bytes.remove_prefix(std::min(bytes.size(), kPieceBytes))) {
        message.set_checkpoint_piece(std::string(bytes.substr(0, kPieceBytes)));
        server.say(message);
      }
      return true;
    });
    message.set_checkpoint_piece("");
    server.say(message);
  };
  hooks.admit_reading = [&](std::int64_t least, std::int64_t most) {
    worker::FromWorker question;
    question.mutable_reading()->set_least(least);
    question.mutable_reading()->set_most(most);
    return outcome_of(server.ask(question));
  };
  hooks.admit = [&](std::int64_t bytes) {
    is_read = true;
    worker::FromWorker question;
    question.mutable_running()->set_most(bytes);
    return outcome_of(server.ask(question));
  };
  hooks.control.spare_memory.take = [&](std::int64_t bytes) {
    worker::FromWorker question;
    question.set_spare(bytes);
    return server.ask(question).lent();
  };
  hooks.control.spare_memory.give_back = [&](std::int64_t bytes) {
    worker::FromWorker message;
    message.set_spare_back(bytes);
    server.say(message);
  };
  hooks.given_up = [&] { return server.given_up(); };
  hooks.open_output = [&](v1::MeshFormat format) {
    output.end();
    worker::FromWorker message;
    message.set_output(format);
    server.say(message);
    return [&](std::string_view bytes) { return output.add(bytes); };
  };
  return hooks;
}

/// Lets the server start the program for HDF5 files.
void ask_for_hdf5(Conversation& server) {
  formats::use_hdf5_starter([&server](const formats::Hdf5Start& start) {
    worker::FromWorker question;
    question.mutable_hdf5()->set_writes(start.writes);
    question.mutable_hdf5()->set_seconds(start.seconds);
    question.mutable_hdf5()->set_memory(start.memory);
    formats::Hdf5Program program;
    program.error = server.ask(question, &program.socket).error();
    return program;
  });
}

RunRequest request_from(const worker::Request& message) {
  RunRequest request;
  request.format = message.format();
  request.options = *options_from(message.options());
  for (const int format : message.outputs()) request.outputs.push_back(static_cast<v1::MeshFormat>(format));
  if (message.has_quality()) request.quality = message.quality();
  if (message.has_geometry()) request.geometry = message.geometry();
  if (message.has_layers()) request.layers = message.layers();
  request.keep_orders = message.keep_orders();
  return request;
}

/// The size of this process's address space, in bytes; 0 if it is not known.
std::int64_t address_space() {
  std::int64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  return pages * sysconf(_SC_PAGESIZE);
}

/// Gives up everything that a run does not need. Returns whether the system has filters for that.
bool confine(const worker::Request& request) {
  Confinement keeps;
  keeps.processor_seconds = request.processor_seconds();
  keeps.memory = address_space() + request.mesh_bytes() + request.checkpoint_bytes() + kBytesBeforeReading;
  keeps.memory_can_be_raised = true;
  keeps.more_descriptors = 16;  // an HDF5 file takes one: the program's socket
  keeps.threads = true;
  return confine_this_process(keeps);
}

worker::FromWorker failure(const Error& error) {
  worker::FromWorker message;
  message.mutable_failure()->set_kind(static_cast<int>(error.kind));
  message.mutable_failure()->set_sentence(as_plain_text(error.sentence));
  return message;
}

/// Tells the outcome, except the outputs, which were told.
void tell(Conversation& server, const RunOutcome& outcome) {
  worker::FromWorker message;
  for (int at = 0; at < outcome.history.iterations_size(); at += kIterationsPerPart) {
    v1::History& part = *message.mutable_history();
    part.Clear();
    for (int i = at; i < std::min(at + kIterationsPerPart, outcome.history.iterations_size()); ++i)
      *part.add_iterations() = outcome.history.iterations(i);
    server.say(message);
  }
  message.mutable_ended()->set_stopped(outcome.stopped);
  message.mutable_ended()->set_unwritten(outcome.unwritten);
  *message.mutable_ended()->mutable_metrics() = outcome.metrics;
  server.say(message);
}

/// @param picture  if set, the job is to write this, and reads no mesh
void run(Conversation& server, RunRequest request, std::string_view checkpoint,
         const std::optional<geometry::ModelTriangles>& picture) {
  std::atomic<bool> is_read = false;
  try {
    Output output(server);
    WorkMeter meter([&](const Work& work) {
      worker::FromWorker message;
      *message.mutable_work() = to_proto(work);
      server.say(message);
    });
    KernelWork told;
    RunHooks hooks = hooks_for(server, output, meter, told, is_read);
    hooks.control.checkpoint = checkpoint;
    const auto outcome = picture ? draw_model(*picture, hooks) : core_engine().run(std::move(request), hooks);
    tell_kernels(server, meter, told);
    if (!outcome) return server.say(failure(outcome.error()));
    output.end();
    tell(server, *outcome);
  } catch (const std::bad_alloc&) {
    server.say(failure(
        is_read ? Error{Error::Kind::Internal,
                        "There was not enough memory for this mesh; use a machine with more memory, or a smaller mesh."}
                : Error{Error::Kind::BadInput,
                        "The mesh file cannot be read: it asks for more memory than a file of its size may take; write "
                        "or copy it again."}));
  } catch (const std::exception& error) {
    server.say(failure(Error{Error::Kind::Internal,
                             std::string("The run ended unexpectedly (") + error.what() + "); please report it."}));
  }
}

int serve() {
  // The server starts an open file, whose number would be the name that ps shows.
  prctl(PR_SET_NAME, "varimesh_worker", 0, 0, 0);
  // The server ends this process. A signal to all processes of a service is not for this one: the server lets it save
  // its state first.
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGPIPE}) std::signal(signal, SIG_IGN);
  Channel channel(kWorkerSocket);
  worker::ToWorker first;
  if (channel.receive(first, -1) != Channel::Got::Message || !first.has_request()) return 2;
  const worker::Request& message = first.request();
  const int mesh = channel.take_file();
  worker::GeometryFile cad;
  int cad_file = -1;
  const bool has_model = message.has_geometry() && !is_on_boundary(message.geometry());
  if (has_model || message.draws_model()) {
    worker::ToWorker next;
    if (channel.receive(next, -1) != Channel::Got::Message || !next.has_geometry()) return 2;
    cad = next.geometry();
    cad_file = channel.take_file();
  }
  int checkpoint_file = -1;
  if (message.checkpoint_bytes() > 0) {
    worker::ToWorker second;
    if (channel.receive(second, -1) != Channel::Got::Message || !second.has_checkpoint()) return 2;
    checkpoint_file = channel.take_file();
  }
  Conversation server(channel);
  if (message.has_hdf5()) ask_for_hdf5(server);
  begin_confinement();
  // While this process can still start programs: one of them reads the CAD file, under limits of its own.
  Expected<geometry::CadModel> model;
  if (has_model) model = geometry::read_model(cad.plugin(), cad_file, "The geometry", cad.most_memory());
  Expected<std::optional<geometry::ModelTriangles>> picture;
  if (message.draws_model()) picture = geometry::read_triangles(cad.plugin(), cad_file, "The model", cad.most_memory());
  worker::FromWorker started;
  started.mutable_started()->set_address_space(address_space());
  started.mutable_started()->set_is_filtered(confine(message));
  server.listen();
  server.say(started);
  if (!model || !picture) {
    server.say(failure(model ? picture.error() : model.error()));
    ::_exit(0);
  }
  RunRequest request = request_from(message);
  if (has_model) request.model = std::make_shared<geometry::CadModel>(std::move(*model));
  request.input = std::make_shared<MappedFile>(mesh, message.mesh_bytes());
  const MappedFile checkpoint(checkpoint_file, message.checkpoint_bytes());
  run(server, std::move(request), checkpoint.bytes(), *picture);
  // Nothing of what a hostile mesh may have left in the memory is run any more.
  ::_exit(0);
}

}  // namespace
}  // namespace varimesh::server

int main() {
  varimesh::return_large_blocks();
  return varimesh::server::serve();
}
