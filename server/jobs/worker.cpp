// The steps of an attempt.
#include "server/jobs/worker.h"

#include <exception>
#include <new>

#include "server/jobs/translate.h"

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

/// Tells the log of every iteration, and the store of one now and then.
class Progress {
 public:
  explicit Progress(const Attempt& attempt) : attempt_(attempt) {}

  Control operator()(const Iteration& iteration) {
    const TimePoint now = attempt_.clock();
    v1::JobEvent event;
    event.set_attempt(attempt_.claim.attempt);
    *event.mutable_time() = timestamp(now);
    *event.mutable_iteration() = to_proto(iteration);
    if (now - noted_ >= std::chrono::milliseconds(500)) {
      noted_ = now;
      attempt_.note_progress(event.iteration());
    }
    attempt_.log.append(std::move(event));
    return attempt_.cancelled() ? Control::Stop : Control::Continue;
  }

 private:
  const Attempt& attempt_;
  TimePoint noted_{};
};

void report_quality(const Attempt& attempt, v1::QualityEvent::Stage stage, const v1::QualityReport& report) {
  v1::JobEvent event;
  event.set_attempt(attempt.claim.attempt);
  *event.mutable_time() = timestamp(attempt.clock());
  event.mutable_quality()->set_stage(stage);
  *event.mutable_quality()->mutable_report() = report;
  attempt.log.append(std::move(event));
}

/// The outputs of a run as they are written, released again unless they are taken.
class Outputs {
 public:
  explicit Outputs(MeshStore& meshes) : meshes_(meshes) {}
  ~Outputs() {
    for (const v1::StoredMesh& mesh : stored_) meshes_.release(mesh.digest());
  }

  /// Ends the output before and opens the next.
  formats::Sink open(v1::MeshFormat format) {
    close();
    auto created = meshes_.create();
    if (!created) {
      failure_ = created.error();
      return [](std::string_view) { return false; };
    }
    writer_ = std::move(*created);
    format_ = format;
    return [this](std::string_view bytes) { return writer_->append(bytes); };
  }

  void close() {
    if (writer_ == nullptr) return;
    const auto stored = writer_->commit();
    writer_.reset();
    if (!stored) {
      failure_ = stored.error();
      return;
    }
    v1::StoredMesh mesh;
    mesh.set_digest(stored->digest);
    mesh.set_size(stored->size);
    mesh.set_format(format_);
    stored_.push_back(std::move(mesh));
  }

  const std::optional<Failure>& failure() const { return failure_; }
  std::vector<v1::StoredMesh> take() { return std::exchange(stored_, {}); }

 private:
  MeshStore& meshes_;
  std::unique_ptr<BlobWriter> writer_;
  v1::MeshFormat format_ = v1::MESH_FORMAT_UNSPECIFIED;
  std::vector<v1::StoredMesh> stored_;
  std::optional<Failure> failure_;
};

Answer<std::string> store_history(MeshStore& meshes, const std::vector<Iteration>& iterations) {
  v1::History history;
  for (const Iteration& iteration : iterations) *history.add_iterations() = to_proto(iteration);
  auto writer = meshes.create();
  if (!writer) return tl::unexpected(writer.error());
  std::string bytes;
  if (!history.SerializeToString(&bytes))
    return failure(Failure::Code::ResourceExhausted, "STORE_FULL",
                   "The history of so many iterations is too large to be kept; lower max_iterations.");
  if (!(*writer)->append(bytes))
    return failure(Failure::Code::ResourceExhausted, "STORE_FULL",
                   "The history of the iterations cannot be written; make room on the server's disk.");
  return (*writer)->commit().map([](const StoredBytes& stored) { return stored.digest; });
}

Ending run(const Attempt& attempt) {
  const v1::JobSpec& spec = attempt.claim.spec;
  auto input = attempt.meshes.open(spec.mesh().digest());
  if (!input) return failed(input.error());
  const auto options = options_from(spec.options());
  if (!options) return failed(Error{Error::Kind::BadOption, options.error().sentence});

  RunRequest request;
  request.input = std::move(*input);
  request.format = spec.mesh().format();
  request.options = *options;
  request.options.threads = options->threads > 0 ? std::min(options->threads, attempt.threads) : attempt.threads;
  for (const int format : spec.outputs()) request.outputs.push_back(static_cast<v1::MeshFormat>(format));

  Progress progress(attempt);
  Outputs outputs(attempt.meshes);
  RunHooks hooks;
  hooks.on_iteration = [&](const Iteration& iteration) { return progress(iteration); };
  hooks.cancelled = attempt.cancelled;
  hooks.open_output = [&](v1::MeshFormat format) { return outputs.open(format); };

  const auto outcome = attempt.engine.run(std::move(request), hooks);
  if (outputs.failure()) return failed(*outputs.failure());
  if (!outcome) return failed(outcome.error());
  Ending ending;
  outputs.close();
  if (outputs.failure()) return failed(*outputs.failure());
  const auto history = store_history(attempt.meshes, outcome->history);
  if (!history) return failed(history.error());

  // A job that was cancelled has the best mesh so far for its result.
  ending.state = outcome->stopped || attempt.cancelled() ? v1::JOB_STATE_CANCELLED : v1::JOB_STATE_SUCCEEDED;
  ending.metrics = metrics(*outcome, *options);
  ending.history_digest = *history;
  report_quality(attempt, v1::QualityEvent::STAGE_BEFORE, ending.metrics->before());
  report_quality(attempt, v1::QualityEvent::STAGE_AFTER, ending.metrics->after());
  ending.results = outputs.take();
  return ending;
}

}  // namespace

Ending run_attempt(const Attempt& attempt) {
  try {
    return run(attempt);
  } catch (const std::bad_alloc&) {
    return failed(Error{Error::Kind::Internal,
                        "The memory did not suffice for this mesh; use a machine with more, or a smaller mesh."});
  } catch (const std::exception& error) {
    return failed(Error{Error::Kind::Internal,
                        std::string("The run ended unexpectedly (") + error.what() + "); please report it."});
  }
}

}  // namespace varimesh::server
