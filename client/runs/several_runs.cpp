#include "client/runs/several_runs.h"

#include <unistd.h>

#include <filesystem>
#include <iostream>
#include <map>
#include <optional>
#include <set>

#include "client/io/documents.h"
#include "client/io/job_table.h"
#include "client/io/outputs.h"
#include "client/jobs/certified_files.h"
#include "client/jobs/connection.h"
#include "client/jobs/result_files.h"
#include "client/jobs/several.h"
#include "client/library/failures.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/utf8.h"
#include "core/mesh/check.h"
#include "core/mesh/plane.h"

namespace varimesh::client {
namespace {

/// A mesh, and where its result goes.
struct Run {
  std::string mesh;
  Output output;
};

/// The meshes with their outputs. Errors: BadOption if two meshes have the same name, or a result would replace its
/// mesh; those of check_outputs().
Expected<std::vector<Run>> runs_into(const std::string& into, const std::vector<std::string>& meshes,
                                     const std::string& format) {
  std::vector<Run> runs;
  std::set<std::string> names;
  for (const std::string& mesh : meshes) {
    if (mesh == "/dev/stdin")
      return bad_option("Standard input has no name, so its result has none; write it with -o.");
    const std::filesystem::path name = std::filesystem::path(mesh).filename(), path = into / name;
    if (!names.insert(name.string()).second)
      return bad_option("Two meshes have the file name " + name.string() + ", so one result would replace the other; " +
                        "optimise them with folders of their own.");
    std::error_code error;
    if (std::filesystem::equivalent(mesh, path, error))
      return bad_option("The result of " + mesh + " would replace the mesh; name another folder with --into.");
    auto outputs = check_outputs({path.string()}, format, mesh);
    if (!outputs) return tl::unexpected(outputs.error());
    runs.push_back({mesh, outputs->front()});
  }
  return runs;
}

/// What belongs to one mesh.
Expected<void> check_for_several(const OptimiseArguments& arguments) {
  for (const auto& [flag, value] : {std::pair{"--history", &arguments.history},
                                    {"--report", &arguments.report},
                                    {"--request-id", &arguments.request_id},
                                    {"--displacements", &arguments.input.displacements},
                                    {"--boundary", &arguments.input.boundary}})
    if (!value->empty())
      return bad_option(std::string(flag) + " belongs to one mesh; leave out --into, and name OUT with -o.");
  return {};
}

/// The jobs of a set of meshes, and what is printed about them.
class Jobs {
 public:
  /// @param input  what all meshes have in common; it has no mesh
  Jobs(Client* client, const CommonFlags& flags, Input input)
      : client_(client), flags_(flags), input_(std::move(input)) {}

  /// Uploads the meshes and submits their jobs. Stops early if there is an interrupt or the server is lost, since it
  /// would refuse all others too.
  Outcome<void> submit(const std::vector<Run>& runs, const v1::JobSpec& spec) {
    for (const Run& run : runs) {
      auto job = interrupted() ? Outcome<v1::Job>(interruption("Interrupted before all jobs were submitted."))
                               : submit(run, spec);
      if (job) {
        jobs_.push_back(*job);
        runs_[job->name()] = &run;
        continue;
      }
      const auto kind = job.error().kind;
      if (kind == Failure::Kind::Transport || kind == Failure::Kind::Interrupted) {
        std::cerr << "varimesh: " << runs.size() - jobs_.size() << " of " << runs.size() << " meshes were not submitted"
                  << std::endl;
        return tl::unexpected(job.error());
      }
      note(print_error(job.error()));
      std::cerr << "varimesh: " << as_plain_text(run.mesh) << " was not optimised" << std::endl;
    }
    return {};
  }

  /// Waits for the jobs and fetches their results.
  Outcome<void> wait() {
    Waiting waiting;
    waiting.on_end = [&](const v1::Job& job) { end(job); };
    waiting.on_deleted = [&](const std::string& name) { lose(name); };
    waiting.on_look = [&](std::size_t ended, std::size_t all) { draw(ended, all); };
    if (const auto ended = wait_for_ends(client_, jobs_, waiting); !ended) return ended;
    if (!runs_.empty()) return interruption("Interrupted before all results were fetched.");
    return {};
  }

  /// Prints why not all jobs are waited for, and returns the exit status.
  int say_why(const Failure& failure) {
    clear();
    return print_error(failure);
  }

  /// Ends the jobs that still run; their best meshes so far are their results.
  void cut_short() {
    clear();
    if (runs_.empty()) return;
    std::cerr << "varimesh: the runs end and their best meshes are written. A second Ctrl-C ends them without results"
              << std::endl;
    keep_calls_going();
    const std::map<std::string, const Run*> open = runs_;
    for (const auto& [name, run] : open) client_->cancel(name);
    for (const auto& [name, run] : open)
      if (const auto ended = client_->watch(name, 0, [](const v1::JobEvent&) { return true; }))
        end(*ended);
      else
        note(print_error(ended.error()));
  }

  /// For jobs of a server that are not waited for any longer.
  void say_where_they_run() {
    clear();
    if (runs_.empty()) return;
    std::cerr << "varimesh: these jobs stay on " << flags_.server << ":";
    for (const auto& [name, run] : runs_) std::cerr << " " << as_plain_text(name);
    std::cerr << "; 'varimesh results JOB… --into DIR' fetches their results" << std::endl;
  }

  /// Prints how all ended, and returns the exit status.
  int finish() {
    clear();
    if (flags_.json)
      print({{"jobs", documents_}});
    else if (!flags_.quiet)
      std::cerr << endings_.sentence() << std::endl;
    if (worst_ != kDone) return worst_;
    const int status = endings_.exit_status();
    return status == kDone && has_uncertified_file_ ? kInvalidLeft : status;
  }

 private:
  /// Uploads the mesh and submits its job.
  Outcome<v1::Job> submit(const Run& run, v1::JobSpec spec) {
    const Input input = input_of(run);
    add_file_label(run.mesh, spec.mutable_labels());
    spec.add_outputs(run.output.format);
    std::optional<formats::MeshFile> moved;
    if (flags_.server.empty() && spec.has_geometry() && spec.geometry().order() == 0) {
      auto file = read_moved(input);
      if (!file) return tl::unexpected(file.error());
      if (is_surface(file->mesh) && !lies_in_a_plane(file->mesh))
        return refusal("BAD_INPUT", "'" + run.mesh +
                                        "' is a surface in space, and the runs of --into cannot slide its nodes. "
                                        "Optimise it by itself, with -o in place of --into.");
      std::error_code failed;
      if (input.changes_mesh() || !std::filesystem::is_regular_file(input.mesh, failed))
        moved = std::move(*file);  // it is not read again: a pipe has been read to its end
    }
    const auto mesh = moved ? upload(*client_, input, moved, {}) : upload(*client_, input);
    if (!mesh) return tl::unexpected(mesh.error());
    spec.mutable_mesh()->set_digest(mesh->digest());
    return client_->submit(spec);
  }

  Input input_of(const Run& run) const {
    Input input = input_;
    input.mesh = run.mesh;
    return input;
  }

  /// The exit status is that of the first error.
  void note(int status) {
    if (worst_ == kDone) worst_ = status;
  }

  /// Fetches the result of a job that has ended. If an interrupt ends that, the run is kept, to be ended again.
  void end(const v1::Job& job) {
    const Run& run = *runs_.at(job.name());
    clear();
    Json files = Json::array();
    if (has_result(job)) {
      if (const auto done = fetch(*client_, job, {run.output}); done)
        files.push_back(run.output.path);
      else if (done.error().kind == Failure::Kind::Interrupted)
        return;
      else
        note(print_error(done.error()));
    }
    runs_.erase(job.name());
    endings_.add(job);
    if (job.has_error()) say_fitting_orders(input_of(run), job);
    if (const std::string left = files.empty() ? "" : uncertified_file({run.output}); !left.empty()) {
      std::cerr << "varimesh: " << as_plain_text(left) << std::endl;
      has_uncertified_file_ = true;
    }
    if (flags_.json) {
      documents_.push_back(document(job));
      documents_.back()["files"] = files;
    } else if (files.empty()) {
      std::cerr << "varimesh: " << as_plain_text(run.mesh) << ": " << ending_of(job) << std::endl;
    } else if (!flags_.quiet) {
      std::cout << as_plain_text(run.output.path) << "  " << ending_of(job) << std::endl;
    }
  }

  void lose(const std::string& name) {
    clear();
    std::cerr << "varimesh: " << as_plain_text(runs_.at(name)->mesh) << ": someone else deleted its job" << std::endl;
    runs_.erase(name);
    endings_.add_deleted();
  }

  void draw(std::size_t ended, std::size_t all) {
    if (flags_.quiet || flags_.json || ended == all || isatty(STDERR_FILENO) != 1) return;
    std::cerr << "\r\x1b[K" << ended << " of " << all << " meshes are done" << std::flush;
    drawn_ = true;
  }
  void clear() {
    if (drawn_) std::cerr << "\r\x1b[K" << std::flush;
    drawn_ = false;
  }

  Client* client_;
  const CommonFlags& flags_;
  Input input_;
  bool has_uncertified_file_ = false;
  std::vector<v1::Job> jobs_;
  std::map<std::string, const Run*> runs_;  ///< Those that have not ended, by the names of their jobs.
  Endings endings_;
  Json documents_ = Json::array();
  int worst_ = kDone;
  bool drawn_ = false;
};

}  // namespace

int optimise_several(OptimiseArguments arguments, const std::vector<std::string>& meshes, const std::string& into) {
  if (const auto fine = check_for_several(arguments); !fine) return print_error(fine.error());
  if (const auto fine = take_layers(&arguments); !fine) return print_error(fine.error());
  if (const auto fine = check_geometry(arguments.input, arguments.options); !fine) return print_error(fine.error());
  if (const auto made = make_folder(into); !made) return print_error(made.error());
  const auto runs = runs_into(into, meshes, arguments.format);
  if (!runs) return print_error(runs.error());
  const auto connection = connect_for(arguments);
  if (!connection) return connection.error();
  v1::JobSpec spec;
  *spec.mutable_options() = arguments.options;
  if (arguments.wanted_layers) *spec.mutable_layers() = *arguments.wanted_layers;
  spec.set_keep_orders(arguments.input.keep_orders);
  Input input = arguments.input;
  auto geometry = hand_over_geometry(*connection->client, &input);
  if (!geometry) return print_error(geometry.error());
  if (*geometry) *spec.mutable_geometry() = std::move(**geometry);

  Jobs jobs(connection->client.get(), arguments.common, std::move(input));
  auto ended = jobs.submit(*runs, spec);
  if (ended) ended = jobs.wait();
  if (ended) return jobs.finish();
  const int status = jobs.say_why(ended.error());
  if (connection->local) {
    jobs.cut_short();
    jobs.finish();
  } else {
    jobs.say_where_they_run();
  }
  return status;
}

}  // namespace varimesh::client
