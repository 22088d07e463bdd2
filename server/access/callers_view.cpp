// Looks at the owner of everything before it is used.
#include "server/access/callers_view.h"

#include <string>
#include <utility>
#include <vector>

#include "core/base/sha256.h"
#include "server/jobs/job_record.h"
#include "server/log/log.h"
#include "server/refusals.h"
#include "server/tracing/spans.h"

namespace varimesh::server {

namespace {

const SpanSink kNobody;

}  // namespace

// ===== jobs =====

Answer<void> CallersView::check_job(const std::string& name) const {
  if (caller_.sees_all()) return {};
  const auto job = scheduler_->get(name);
  if (!job) return tl::unexpected(job.error());
  if (job->owner() != caller_.owner) return job_not_found(name);
  return {};
}

Answer<v1::Job> CallersView::submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only) const {
  const TimePoint begin = std::chrono::system_clock::now();
  OpenSpan span(validate_only ? kNobody : scheduler_->spans(), "submit", caller_.trace, begin, Span::Kind::Server);
  auto job = try_submit(request_id, spec, validate_only, span.context());
  if (job)
    span.set("varimesh.job", job->name());
  else
    span.fail(job.error().reason);
  span.end(std::chrono::system_clock::now());
  if (!validate_only)
    audit("submit", job ? job->name() : "a job", job ? "ok" : job.error().reason, fields_about(job ? job->name() : ""));
  if (!job || caller_.rights.contains(kRead)) return job;
  // Who may not read learns the name of the job and what was sent: a request id that is repeated is no way to look at
  // how the job goes.
  v1::Job receipt;
  receipt.set_name(job->name());
  receipt.set_owner(job->owner());
  receipt.set_request_id(job->request_id());
  *receipt.mutable_spec() = spec;
  if (!validate_only) *receipt.mutable_create_time() = job->create_time();
  return receipt;
}

LogFields CallersView::fields_about(const std::string& job) const {
  LogFields fields = caller_.log_fields();
  fields.job = job;
  return fields;
}

Answer<v1::Job> CallersView::try_submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only,
                                        const TraceContext& trace) const {
  for (const std::string& digest : inputs_of(spec))
    if (is_sha256(digest) && !may_use(digest)) return mesh_missing(digest);
  if (const auto room = meshes_->check_share(caller_.owner, 0); !room) return tl::unexpected(room.error());
  // On a server that does not ask who calls, everybody is an admin.
  const bool is_admin = caller_.sees_all() && !caller_.owner.empty();
  return scheduler_->submit(request_id, spec, validate_only, {caller_.peer, caller_.owner, is_admin, trace.header()});
}

Answer<v1::Job> CallersView::get(const std::string& name) const {
  auto job = scheduler_->get(name);
  if (job && !caller_.sees_all() && job->owner() != caller_.owner) return job_not_found(name);
  return job;
}

Answer<JobPage> CallersView::list(JobFilter filter, int page_size, const std::string& page_token) const {
  if (!caller_.sees_all()) filter.owner = caller_.owner;
  return scheduler_->list(filter, page_size, page_token);
}

Answer<v1::Job> CallersView::cancel(const std::string& name) const {
  const auto checked = check_job(name);
  auto cancelled = checked ? scheduler_->cancel(name) : tl::unexpected(checked.error());
  audit("cancel", name, cancelled ? "ok" : cancelled.error().reason, fields_about(name));
  return cancelled;
}

Answer<v1::Job> CallersView::remove(const std::string& name) const {
  const auto checked = check_job(name);
  auto removed = checked ? scheduler_->remove(name) : tl::unexpected(checked.error());
  audit("delete", name, removed ? "ok" : removed.error().reason, fields_about(name));
  return removed;
}

Answer<std::shared_ptr<EventLog>> CallersView::events(const std::string& name) const {
  if (const auto checked = check_job(name); !checked) return tl::unexpected(checked.error());
  return scheduler_->events(name);
}

Answer<std::shared_ptr<const std::string>> CallersView::watch_mesh(const std::string& name) const {
  const auto log = events(name);
  if (!log) return tl::unexpected(log.error());
  return (*log)->watch_mesh();
}

// ===== meshes =====

Answer<UploadTicket> CallersView::begin_upload(const std::string& id, const std::string& digest,
                                               std::int64_t size) const {
  return meshes_->begin_upload(id, digest, size, caller_.owner);
}

Answer<UploadProgress> CallersView::query_upload(const std::string& id, const std::string& digest) const {
  return meshes_->query_upload(id, digest, caller_.owner);
}

Answer<std::unique_ptr<BlobReader>> CallersView::read(const std::string& digest) const {
  if (!may_use(digest)) return mesh_not_found(digest);
  return meshes_->read(digest);
}

Answer<void> CallersView::remove_mesh(const std::string& digest) const {
  auto removed = try_remove_mesh(digest);
  audit("delete mesh", digest, removed ? "ok" : removed.error().reason, caller_.log_fields());
  return removed;
}

Answer<void> CallersView::try_remove_mesh(const std::string& digest) const {
  if (caller_.sees_all()) return meshes_->remove(digest, "");
  if (!may_use(digest)) return mesh_not_found(digest);
  // The store counts the jobs of all owners, and the answer must not tell whether there are others.
  const auto used = scheduler_->has_job_with(caller_.owner, digest);
  if (!used) return tl::unexpected(used.error());
  if (*used) return mesh_in_use(digest);
  return meshes_->remove(digest, caller_.owner);
}

}  // namespace varimesh::server
