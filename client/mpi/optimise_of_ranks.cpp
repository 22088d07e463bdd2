#include "client/mpi/optimise_of_ranks.h"

#include <cstdint>
#include <deque>
#include <iostream>
#include <new>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "client/io/documents.h"
#include "client/io/history.h"
#include "client/io/outputs.h"
#include "client/io/report_page.h"
#include "client/io/summary.h"
#include "client/local/shared_run.h"
#include "client/mpi/checkpoint_file.h"
#include "client/mpi/read_everywhere.h"
#include "client/process/exit_status.h"
#include "client/process/interrupts.h"
#include "core/base/io/output_file.h"
#include "core/base/version.h"
#include "core/ranks/to_all.h"

namespace varimesh::client {
namespace {

Expected<void> refuse(const std::string& what, const std::string& why) {
  return bad_option("varimesh-mpi does not take " + what + ", because " + why +
                    "; 'varimesh optimise' does this in one process.");
}

/// What is not shared yet, or only one process can do.
Expected<void> check_flags(const OptimiseArguments& arguments) {
  const v1::Options& options = arguments.options;
  if (arguments.input.mesh == "-") return refuse("standard input", "only one process has it");
  if (options.objective() == v1::OBJECTIVE_WORST) return refuse("--objective worst", "its stages are not shared");
  if (!arguments.common.server.empty()) return refuse("--server", "the work is done by its own processes");
  if (arguments.input.slides()) return refuse("a geometry", "sliding is not shared");
  if (arguments.input.changes_mesh()) return refuse("flags that change the mesh", "this is not shared");
  if (arguments.layers.layers.walls_size() > 0) return refuse("layers", "they are not shared");
  if (options.order() > 0) return refuse("--order", "a change of order is not shared");
  if (options.repair() != v1::REPAIR_UNSPECIFIED && options.repair() != v1::REPAIR_NONE)
    return refuse("--repair", "repairs are not shared");
  if (options.device() != v1::DEVICE_UNSPECIFIED && options.device() != v1::DEVICE_CPU)
    return refuse(options.device() == v1::DEVICE_GPU ? "--device gpu" : "--device auto", "processes share no device");
  if (!arguments.request_id.empty()) return refuse("--request-id", "there is no server to which it could be sent");
  return {};
}

/// The ranks go on together because all have the same numbers, and these depend on the kernels.
Expected<void> check_processors(const Ranks& ranks) {
  if (have_same(vector_instructions(), ranks)) return {};
  return bad_option(
      "The processors of the ranks have different vector instructions, so their numbers would differ; use machines of "
      "one kind.");
}

/// The outputs of the first rank.
class Files {
 public:
  /// `formats`: those of the outputs, each once, and perhaps one that only the report needs.
  /// @param keeps  the first result in a format that can be read is kept in memory
  Files(const std::vector<Output>& outputs, const std::vector<v1::MeshFormat>& formats, bool keeps)
      : outputs_(outputs), formats_(formats), keeps_(keeps) {}

  /// Opens the files of the next of these formats.
  Sink open_next() {
    const v1::MeshFormat format = formats_[next_++];
    std::vector<OutputFile*> files;
    for (const Output& output : outputs_) {
      if (output.format != format) continue;
      auto file = OutputFile::open(output.path);
      if (!file) {
        if (!fault_) fault_ = file.error();
        return [](std::string_view) { return false; };
      }
      files.push_back(&files_.emplace_back(std::move(*file)));
    }
    const bool keeps = keeps_ && readable(format);
    keeps_ = keeps_ && !keeps;
    return [this, files, keeps](std::string_view bytes) {
      if (keeps) kept_ += bytes;
      for (OutputFile* file : files)
        if (!file->write(bytes)) return false;
      return true;
    };
  }
  const std::string& kept() const { return kept_; }
  /// Why a file could not be opened or written, if one could not. Errors: Output.
  Expected<void> check() {
    if (fault_) return tl::unexpected(*fault_);
    for (OutputFile& file : files_)
      if (file.failed()) return file.commit();
    return {};
  }
  /// Gives all files their names. Errors: Output.
  Expected<void> commit() {
    for (OutputFile& file : files_)
      if (const auto done = file.commit(); !done) return done;
    return {};
  }

 private:
  const std::vector<Output>& outputs_;
  const std::vector<v1::MeshFormat>& formats_;
  bool keeps_;
  std::string kept_;
  std::size_t next_ = 0;
  std::deque<OutputFile> files_;
  std::optional<Error> fault_;
};

/// The outputs, and what an interrupt of any rank has to do with them.
struct Ending {
  const std::vector<Output>& outputs;
  bool interrupted = false;
  const std::string &before, &after;  ///< The mesh and the result, for the report.
};

/// Writes the history and the report if they are asked for, prints what `varimesh optimise` prints, and returns the
/// exit status.
int print_result(const OptimiseArguments& arguments, const SharedOutcome& outcome, const Ending& ending) {
  const std::vector<v1::Iteration> iterations(outcome.history.iterations().begin(), outcome.history.iterations().end());
  if (!arguments.history.empty())
    if (const auto written = write_history(arguments.history, iterations); !written)
      return print_error(written.error());
  if (!arguments.report.empty())
    if (const auto written =
            write_run_report(arguments.report, arguments.input.mesh,
                             {outcome.metrics, arguments.options, iterations, ending.before, ending.after});
        !written)
      return print_error(written.error());
  if (arguments.common.json)
    print(document(outcome.metrics));
  else if (!arguments.common.quiet)
    std::cout << summary(outcome.metrics, arguments.options);
  const v1::Certified& certified = outcome.metrics.after().certified();
  const int status = print_uncertified(certified.invalid(), certified.undecided());
  if (!ending.interrupted) return status;
  std::cerr << "varimesh: " << interruption_text(outcome.metrics, outcome.stopped, ending.outputs) << std::endl;
  return kInterrupted;
}

/// Sets the outputs on the first rank, after a check that all files can be written. Errors: BadOption, Output.
Expected<void> check_files(const OptimiseArguments& arguments, const Ranks& ranks, std::vector<Output>& outputs) {
  return ranks.together([&]() -> Expected<void> {
    if (!ranks.is_first()) return {};
    auto checked = check_outputs(arguments.outputs, arguments.format, arguments.input.mesh);
    if (!checked) return tl::unexpected(checked.error());
    outputs = std::move(*checked);
    const std::vector<std::string> others{arguments.history, arguments.report, arguments.checkpoint};
    std::vector<Output> written = outputs;
    for (const std::string& path : others) written.push_back({path});
    if (any_is_standard_output(written)) return refuse("standard output", "launchers mix what processes write to it");
    return check_distinct(outputs, others, arguments.common.json);
  });
}

/// Whether a limit or the caller has ended the run, so that it may go on later.
bool may_go_on(const v1::Metrics& metrics) {
  const v1::StopReason reason = metrics.stop_reason();
  return reason == v1::STOP_REASON_STOPPED || reason == v1::STOP_REASON_TIME_LIMIT ||
         reason == v1::STOP_REASON_ITERATIONS;
}

/// Lets the run keep its state in the file, and says once that this is not possible.
void keep_state(CheckpointFile& file, SharedRun& run) {
  run.checkpoint = file.state();
  run.checkpoint_due = [&] { return file.is_due(); };
  run.save_checkpoint = [&file, note = run.on_note, said = false](const WriteCheckpoint& write) mutable {
    const auto saved = file.save(write);
    if (!saved && note && !std::exchange(said, true)) note(saved.error().sentence + " The run goes on.");
  };
}

}  // namespace

int optimise_of_ranks(const OptimiseArguments& arguments, const Ranks& ranks) {
  std::optional<EndAtInterrupt> until_it_runs(std::in_place);
  if (const auto checked = check_flags(arguments); !checked) return print_error(checked.error());
  if (const auto same = check_processors(ranks); !same) return print_error(same.error());
  std::vector<Output> outputs;
  if (const auto writable = check_files(arguments, ranks, outputs); !writable) return print_error(writable.error());
  CheckpointFile checkpoint(arguments.checkpoint, arguments.checkpoint_interval);
  const bool keeps_state = !arguments.checkpoint.empty();
  if (const auto read = keeps_state ? checkpoint.read(ranks) : Expected<void>(); !read)
    return print_error(read.error());
  auto bytes = read_everywhere(arguments.input.mesh, ranks);
  if (!bytes) return print_error(bytes.error());
  // All ranks know the formats, so that a mesh that one cannot hold is refused by all.
  const std::vector<v1::MeshFormat> formats = ranks.gather_everywhere(
      ranks.is_first() ? formats_with_report(formats_of(outputs), arguments.report) : std::vector<v1::MeshFormat>());
  const bool reports = ranks.is_first() && !arguments.report.empty();
  Files files(outputs, formats, reports);
  const std::string before = reports ? *bytes : std::string();
  SharedRun run;
  run.mesh = std::move(*bytes);
  run.options = arguments.options;
  run.outputs = formats;
  run.keep_orders = arguments.input.keep_orders;
  run.open_output = [&] { return files.open_next(); };
  if (!arguments.common.quiet) run.on_note = [](const std::string& note) { std::cerr << note << std::endl; };
  run.on_begin = [&] { until_it_runs.reset(); };
  run.stop_asked = interrupted;
  if (keeps_state) keep_state(checkpoint, run);
  const auto outcome = run_shared(std::move(run), ranks);
  const bool was_interrupted = ranks.any(interrupted());
  if (const auto written = files.check(); !written) return print_error(written.error());
  if (!outcome) return print_error(outcome.error());
  if (!ranks.is_first()) return kDone;
  if (const auto written = files.commit(); !written) return print_error(written.error());
  if (keeps_state && !may_go_on(outcome->metrics)) checkpoint.remove();
  return print_result(arguments, *outcome, {outputs, was_interrupted, before, files.kept()});
}

}  // namespace varimesh::client
