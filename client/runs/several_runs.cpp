#include "client/runs/several_runs.h"

#include <unistd.h>

#include <filesystem>
#include <iostream>
#include <map>
#include <set>

#include "client/io/documents.h"
#include "client/io/job_table.h"
#include "client/io/outputs.h"
#include "client/jobs/connection.h"
#include "client/jobs/result_files.h"
#include "client/jobs/several.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/utf8.h"

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
  Jobs(Client* client, const CommonFlags& flags) : client_(client), flags_(flags) {}

  /// Uploads the mesh and submits its job. Returns the exit status; if it is not kDone, an error has been printed.
  int submit(const Run& run, Input input, v1::JobSpec spec) {
    input.mesh = run.mesh;
    add_file_label(run.mesh, spec.mutable_labels());
    spec.add_outputs(run.output.format);
    const auto mesh = upload(*client_, input);
    if (!mesh) return refuse(run, print_error(mesh.error()));
    spec.mutable_mesh()->set_digest(mesh->digest());
    const auto job = client_->submit(spec);
    if (!job) return refuse(run, print_error(job.error()));
    jobs_.push_back(*job);
    runs_[job->name()] = &run;
    return kDone;
  }

  Outcome<void> wait() {
    Waiting waiting;
    waiting.on_end = [&](const v1::Job& job) { end(job); };
    waiting.on_deleted = [&](const std::string& name) { lose(name); };
    waiting.on_look = [&](std::size_t ended, std::size_t all) { draw(ended, all); };
    return wait_for_ends(client_, jobs_, waiting);
  }

  /// Ends the jobs that still run; their best meshes so far are their results.
  void cut_short() {
    clear();
    std::cerr << "varimesh: interrupted; the runs end and their best meshes are written. A second Ctrl-C gives them up"
              << std::endl;
    keep_calls_going();
    const std::map<std::string, const Run*> open = runs_;
    for (const auto& [name, run] : open) client_->cancel(name);
    for (const auto& [name, run] : open)
      if (const auto ended = client_->watch(name, 0, [](const v1::JobEvent&) { return true; })) end(*ended);
  }

  void say_where_they_run() const {
    std::cerr << "varimesh: interrupted; the jobs go on running on " << flags_.server
              << ". 'varimesh jobs' lists them, and "
              << "'varimesh results JOB… --into DIR' fetches their results" << std::endl;
  }

  /// Prints how all ended, and returns the exit status.
  int finish() {
    clear();
    if (flags_.json)
      print({{"jobs", documents_}});
    else if (!flags_.quiet)
      std::cerr << endings_.sentence() << std::endl;
    if (worst_ != kDone) return worst_;
    return endings_.exit_status();
  }

 private:
  int refuse(const Run& run, int status) {
    if (worst_ == kDone) worst_ = status;
    std::cerr << "varimesh: " << as_plain_text(run.mesh) << " was not optimised" << std::endl;
    return status;
  }

  void end(const v1::Job& job) {
    const Run& run = *runs_.at(job.name());
    runs_.erase(job.name());
    endings_.add(job);
    clear();
    Json files = Json::array();
    if (has_result(job)) {
      if (const auto done = fetch(*client_, job, {run.output}); !done)
        worst_ = print_error(done.error());
      else
        files.push_back(run.output.path);
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
  const bool in_process = arguments.common.server.empty();
  v1::JobSpec spec;
  *spec.mutable_options() = arguments.options;
  if (arguments.wanted_layers) *spec.mutable_layers() = *arguments.wanted_layers;
  Input input = arguments.input;
  auto geometry = hand_over_geometry(*connection->client, &input);
  if (!geometry) return print_error(geometry.error());
  if (*geometry) *spec.mutable_geometry() = std::move(**geometry);

  Jobs jobs(connection->client.get(), arguments.common);
  for (const Run& run : *runs)
    // A server that is lost refuses all others too.
    if (const int status = jobs.submit(run, input, spec); status == kServer || status == kInterrupted) return status;
  const auto ended = jobs.wait();
  if (ended) return jobs.finish();
  if (ended.error().kind != Failure::Kind::Interrupted) return print_error(ended.error());
  if (in_process) {
    jobs.cut_short();
    jobs.finish();
  } else {
    jobs.say_where_they_run();
  }
  return kInterrupted;
}

}  // namespace varimesh::client
