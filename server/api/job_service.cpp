// Handlers of JobService. Each translates the request, asks the scheduler and answers.
#include "server/api/job_service.h"

#include <optional>

#include "core/base/version.h"
#include "server/api/result_source.h"
#include "server/engine/translate.h"
#include "server/jobs/timestamps.h"
#include "server/refusals.h"
#include "server/streams/event_source.h"

namespace varimesh::server {
namespace {

/// Whether a client may ask for this time between the iterations that it sees: not negative, and at most an hour.
bool is_interval(const google::protobuf::Duration& time) {
  return time.seconds() >= 0 && time.seconds() <= 3600 && time.nanos() >= 0 && time.nanos() < 1'000'000'000;
}

/// Answers with the job, or with the reason why there is none.
template <class Response>
grpc::Status answer(Answer<v1::Job> job, Response* response) {
  if (!job) return status(job.error());
  *response->mutable_job() = std::move(*job);
  return grpc::Status::OK;
}

/// Removes the lists of elements, since a list of jobs is an overview. GetJob has them.
void shorten(v1::Job& job) {
  if (!job.has_metrics()) return;
  v1::Metrics& metrics = *job.mutable_metrics();
  for (v1::QualityReport* report : {metrics.mutable_before(), metrics.mutable_after()}) {
    report->clear_invalid();
    report->mutable_certified()->clear_uncertified();
    report->clear_clockwise();
  }
  metrics.clear_unrepairable();
  metrics.clear_repairs();
  if (metrics.has_substitute_targets()) metrics.mutable_substitute_targets()->clear_elements();
  if (metrics.has_geometry()) metrics.mutable_geometry()->clear_elements();
}

v1::ServerLimits to_proto(const Limits& limits) {
  v1::ServerLimits all;
  all.set_max_mesh_bytes(limits.max_mesh_bytes);
  all.set_max_pending_jobs(limits.max_pending_jobs);
  all.set_threads(limits.threads);
  all.set_max_pending_jobs_per_peer(limits.max_pending_jobs_per_peer);
  all.set_max_running_jobs_per_peer(limits.max_running_jobs_per_peer);
  all.set_max_watches_per_peer(limits.max_watches_per_peer);
  all.set_max_uploads_per_peer(limits.max_uploads_per_peer);
  all.set_max_bytes_per_owner(limits.max_bytes_per_owner);
  all.set_max_ended_jobs(limits.max_ended_jobs);
  const auto seconds = [](auto time) { return std::chrono::duration_cast<std::chrono::seconds>(time).count(); };
  all.mutable_min_ended_age()->set_seconds(seconds(limits.min_ended_age));
  if (limits.max_ended_age.count() > 0) all.mutable_max_ended_age()->set_seconds(seconds(limits.max_ended_age));
  all.mutable_mesh_lifetime()->set_seconds(seconds(limits.mesh_lifetime));
  return all;
}

}  // namespace

JobService::JobService(const ApiContext& api) : api_(api) {
  MarkMethodRawCallback(index_of("varimesh.v1.JobService.SubmitJob"), unparsed(this, &JobService::submit));
  MarkMethodRawCallback(index_of("varimesh.v1.JobService.GetJob"), unparsed(this, &JobService::get));
  MarkMethodRawCallback(index_of("varimesh.v1.JobService.ListJobs"), unparsed(this, &JobService::list));
  MarkMethodRawCallback(index_of("varimesh.v1.JobService.CancelJob"), unparsed(this, &JobService::cancel));
  MarkMethodRawCallback(index_of("varimesh.v1.JobService.DeleteJob"), unparsed(this, &JobService::remove));
  MarkMethodRawCallback(index_of("varimesh.v1.JobService.WatchJob"), unparsed(this, &JobService::watch));
  MarkMethodRawCallback(index_of("varimesh.v1.JobService.GetResult"), unparsed(this, &JobService::result));
  MarkMethodRawCallback(index_of("varimesh.v1.JobService.GetServerInfo"), unparsed(this, &JobService::info));
}

grpc::ServerUnaryReactor* JobService::submit(Call* call, const Request* bytes, v1::SubmitJobResponse* response) {
  return unary<v1::SubmitJobRequest>(
      api_, call, Method::SubmitJob, bytes,
      [response](const CallersView& view, const v1::SubmitJobRequest& request) {
        return answer(view.submit(request.request_id(), request.spec(), request.validate_only()), response);
      },
      kMostSpecBytes);
}

grpc::ServerUnaryReactor* JobService::get(Call* call, const Request* bytes, v1::GetJobResponse* response) {
  return unary<v1::GetJobRequest>(api_, call, Method::GetJob, bytes,
                                  [response](const CallersView& view, const v1::GetJobRequest& request) {
                                    return answer(view.get(request.name()), response);
                                  });
}

grpc::ServerUnaryReactor* JobService::list(Call* call, const Request* bytes, v1::ListJobsResponse* response) {
  const auto work = [this, response](const CallersView& view, const v1::ListJobsRequest& request) {
    JobFilter filter;
    for (const int state : request.states()) filter.states.insert(static_cast<v1::JobState>(state));
    filter.labels.insert(request.labels().begin(), request.labels().end());
    const auto before = api_.pages.open(request.page_token(), view.caller());
    if (!before) return status(before.error());
    auto page = view.list(std::move(filter), request.page_size(), *before);
    if (!page) return status(page.error());
    for (v1::Job& job : page->jobs) {
      shorten(job);
      *response->add_jobs() = std::move(job);
    }
    response->set_next_page_token(api_.pages.seal(page->next_page_token, view.caller()));
    return grpc::Status::OK;
  };
  return unary<v1::ListJobsRequest>(api_, call, Method::ListJobs, bytes, work);
}

grpc::ServerUnaryReactor* JobService::cancel(Call* call, const Request* bytes, v1::CancelJobResponse* response) {
  return unary<v1::CancelJobRequest>(api_, call, Method::CancelJob, bytes,
                                     [response](const CallersView& view, const v1::CancelJobRequest& request) {
                                       return answer(view.cancel(request.name()), response);
                                     });
}

grpc::ServerUnaryReactor* JobService::remove(Call* call, const Request* bytes, v1::DeleteJobResponse*) {
  return unary<v1::DeleteJobRequest>(api_, call, Method::DeleteJob, bytes,
                                     [](const CallersView& view, const v1::DeleteJobRequest& request) {
                                       const auto removed = view.remove(request.name());
                                       return removed ? grpc::Status::OK : status(removed.error());
                                     });
}

JobService::Stream<v1::WatchJobResponse>* JobService::watch(Call* call, const Request* bytes) {
  // The first pull looks the job up, on the pool.
  struct Watch {
    explicit Watch(const CallersView& callers) : view(callers) {}
    const CallersView view;
    std::shared_ptr<const void> place;
    v1::WatchJobRequest request;
    std::weak_ptr<Listener> listener;
    std::optional<EventSource> events;
  };
  using Out = StreamOut<v1::WatchJobResponse>;
  auto watch = std::make_shared<std::shared_ptr<Watch>>();
  return Out::open(
      api_, call, Method::WatchJob,
      [this, bytes, watch](const CallersView& view) -> Answer<Out::Source> {
        auto request = parse<v1::WatchJobRequest>(*bytes);
        if (!request) return tl::unexpected(request.error());
        if (!is_interval(request->min_interval()))
          return bad_request("The interval between iterations must be from 0 to 3600 seconds.");
        auto made = *watch = std::make_shared<Watch>(view);
        made->request = std::move(*request);
        const std::string& peer = view.caller().peer;
        made->place = api_.watches.take(peer);
        if (made->place == nullptr) return peer_limit(peer, api_.watches.most(), "open watches");
        return Out::Source([this, made](v1::WatchJobResponse* response, bool idle, grpc::Status* ended) {
          if (!made->events) {
            auto log = made->view.events(made->request.name());
            *ended = log ? check_resumption(made->request, **log) : status(log.error());
            if (!ended->ok()) return Pull::End;
            (*log)->subscribe(made->listener);
            const auto interval = std::chrono::seconds(made->request.min_interval().seconds()) +
                                  std::chrono::nanoseconds(made->request.min_interval().nanos());
            made->events.emplace(std::move(*log), made->request.after_sequence(), interval);
          }
          return made->events->pull(response->mutable_event(), idle);
        });
      },
      [watch](std::weak_ptr<Listener> listener) { (*watch)->listener = std::move(listener); });
}

grpc::Status JobService::check_resumption(const v1::WatchJobRequest& request, const EventLog& log) {
  if (request.after_sequence() >= 0 && log.can_resume_after(request.after_sequence())) return grpc::Status::OK;
  const auto job = api_.scheduler.get(request.name());
  return status(sequence_expired(request.name(), request.after_sequence(), log.oldest_sequence()),
                job ? &*job : nullptr);
}

JobService::Stream<v1::GetResultResponse>* JobService::result(Call* call, const Request* bytes) {
  // The first pull looks the job up, on the pool.
  using Out = StreamOut<v1::GetResultResponse>;
  return Out::open(api_, call, Method::GetResult, [this, bytes](const CallersView& view) -> Answer<Out::Source> {
    const auto request = parse<v1::GetResultRequest>(*bytes);
    if (!request) return tl::unexpected(request.error());
    const std::string& peer = view.caller().peer;
    auto place = api_.downloads.take(peer);
    if (place == nullptr) return peer_limit(peer, api_.downloads.most(), "open downloads");
    auto result = std::make_shared<std::optional<ResultSource>>();
    return Out::Source(
        [this, view, place = std::move(place), result, name = request->name(),
         with_meshes = !request->without_meshes()](v1::GetResultResponse* response, bool, grpc::Status* ended) {
          if (!*result) {
            auto job = view.get(name);
            if (job && job->results().empty()) job = job_without_result(name, v1::JobState_Name(job->state()));
            if (!job) {
              *ended = status(job.error());
              return Pull::End;
            }
            result->emplace(api_, std::move(*job), with_meshes);
          }
          ResultSource::Piece piece;
          const auto got = (*result)->pull(&piece);
          if (!got) *ended = status(got.error());
          if (!got || *got != Pull::Message) return got.value_or(Pull::End);
          if (piece.job) *response->mutable_job() = std::move(*piece.job);
          if (piece.history) *response->mutable_history() = std::move(*piece.history);
          if (piece.chunk) *response->mutable_chunk() = std::move(*piece.chunk);
          return Pull::Message;
        });
  });
}

grpc::ServerUnaryReactor* JobService::info(Call* call, const Request* bytes, v1::GetServerInfoResponse* response) {
  const auto work = [this, response](const CallersView& view, const v1::GetServerInfoRequest&) {
    response->set_version(std::string(version()));
    *response->mutable_limits() = to_proto(api_.limits);
    for (int format = v1::MESH_FORMAT_MSH22; v1::MeshFormat_IsValid(format); ++format) {
      if (is_readable(static_cast<v1::MeshFormat>(format)))
        response->add_input_formats(static_cast<v1::MeshFormat>(format));
      if (is_writable(static_cast<v1::MeshFormat>(format)))
        response->add_output_formats(static_cast<v1::MeshFormat>(format));
    }
    for (int energy = v1::ENERGY_HYPERELASTIC; v1::Energy_IsValid(energy); ++energy)
      response->add_energies(static_cast<v1::Energy>(energy));
    response->set_takes_geometries(api_.scheduler.takes_geometries());
    response->set_takes_layers(true);
    response->set_keeps_orders(true);
    response->set_takes_webhooks(api_.scheduler.takes_webhooks());
    const LentDevices lent = api_.scheduler.lent_devices();
    response->set_device(lent.names);
    response->set_devices(lent.devices);
    if (!view.caller().rights.contains(kRead)) return grpc::Status::OK;
    *response->mutable_start_time() = timestamp(api_.start_time);
    const auto counts = api_.scheduler.counts();
    if (!counts) return status(counts.error());
    response->set_pending_jobs(counts->pending);
    response->set_running_jobs(counts->running);
    response->set_busy_devices(lent.busy);
    response->set_jobs_on_devices(lent.jobs);
    if (const auto bytes = view.share()) response->set_owner_bytes(*bytes);
    return grpc::Status::OK;
  };
  return unary<v1::GetServerInfoRequest>(api_, call, Method::GetServerInfo, bytes, work);
}

}  // namespace varimesh::server
