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
#include <csignal>
#include <cstdint>
#include <exception>
#include <fstream>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <utility>

#include "core/base/machine_memory.h"
#include "core/base/utf8.h"
#include "core/formats/hdf5/starter.h"
#include "core/geometry/load.h"
#include "core/process/sandbox.h"
#include "server/engine/engine.h"
#include "server/engine/geometry_messages.h"
#include "server/engine/models/draw_model.h"
#include "server/engine/translate.h"
#include "server/isolation/channel.h"
#include "server/isolation/messages.h"
#include "server/isolation/socket_of_worker.h"
#include "server/isolation/worker.pb.h"
#include "server/isolation/worker/device_of_worker.h"
#include "server/isolation/worker/mapped_file.h"
#include "server/isolation/worker/talk.h"

// Highway measures a clock for 7 ms when it is loaded, for benchmarks that nobody runs here.
namespace hwy::platform {
std::uint64_t TimerResolution();
std::uint64_t TimerResolution() { return 1; }
}  // namespace hwy::platform

namespace varimesh::server {
namespace {

/// What a process takes, mostly reserved for threads, before the server knows what its run needs.
constexpr std::int64_t kBytesBeforeReading = std::int64_t{1} << 30;
/// Iterations in one message of the history.
constexpr int kIterationsPerPart = 10'000;

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

/// The size of this process's address space or, with a device, of what it can write and shares with nobody, in bytes; 0
/// if it is not known.
std::int64_t address_space(const DeviceOfWorker& device) {
  std::int64_t all = 0, resident = 0, shared = 0, text = 0, none = 0, own = 0;  // pages
  std::ifstream("/proc/self/statm") >> all >> resident >> shared >> text >> none >> own;
  return (device.is_open() ? own : all) * sysconf(_SC_PAGESIZE);
}

/// Gives up everything that a run does not need. Returns whether the system has filters for that.
bool confine(const worker::Request& request, const DeviceOfWorker& device) {
  Confinement keeps;
  keeps.has_device = device.is_open();
  keeps.has_threads = device.has_opened_driver();
  keeps.processor_seconds = request.processor_seconds();
  keeps.memory = address_space(device) + request.mesh_bytes() + request.checkpoint_bytes() + kBytesBeforeReading;
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
void run(Conversation& server, RunRequest request, DeviceOfWorker& device, std::string_view checkpoint,
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
    device.add_to(hooks, request, [&server] {
      worker::FromWorker message;
      message.set_device_unused(true);
      server.say(message);
    });
    hooks.control.checkpoint = checkpoint;
    auto outcome = picture ? draw_model(*picture, hooks) : core_engine().run(std::move(request), hooks);
    tell_kernels(server, meter, told);
    if (!outcome) return server.say(failure(outcome.error()));
    output.end();
    device.tell(outcome->metrics);
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
  DeviceOfWorker device(message.device(), message.why_no_device());
  worker::FromWorker started;
  device.tell(*started.mutable_started());
  started.mutable_started()->set_address_space(address_space(device));
  started.mutable_started()->set_is_filtered(confine(message, device));
  server.say(started);
  if (message.only_opens_device()) ::_exit(0);
  server.listen();
  if (!model || !picture) {
    server.say(failure(model ? picture.error() : model.error()));
    ::_exit(0);
  }
  RunRequest request = request_of(message);
  if (has_model) request.model = std::make_shared<geometry::CadModel>(std::move(*model));
  request.input = std::make_shared<MappedFile>(mesh, message.mesh_bytes());
  const MappedFile checkpoint(checkpoint_file, message.checkpoint_bytes());
  run(server, std::move(request), device, checkpoint.bytes(), *picture);
  // Nothing of what a hostile mesh may have left in the memory is run any more.
  ::_exit(0);
}

}  // namespace
}  // namespace varimesh::server

int main() {
  varimesh::return_large_blocks();
  return varimesh::server::serve();
}
