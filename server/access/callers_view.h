// The jobs and meshes of a server as one caller sees them: those of other owners are not there.
#pragma once

#include <memory>
#include <string>

#include "server/access/access.h"
#include "server/meshes/mesh_store.h"
#include "server/scheduling/scheduler.h"

namespace varimesh::server {

/// Every handler of a call uses the scheduler and the mesh store through this object. What belongs to another owner is
/// refused with the same words as what does not exist. Thread-safe; all calls may wait for a disk.
class CallersView {
 public:
  CallersView(Scheduler& scheduler, MeshStore& meshes, Caller caller)
      : scheduler_(&scheduler), meshes_(&meshes), caller_(std::move(caller)) {}

  const Caller& caller() const { return caller_; }

  // As Scheduler has them.
  /// The mesh must be the caller's: who knows only its digest cannot use it.
  Answer<v1::Job> submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only) const;
  Answer<v1::Job> get(const std::string& name) const;
  Answer<JobPage> list(JobFilter filter, int page_size, const std::string& page_token) const;
  Answer<v1::Job> cancel(const std::string& name) const;
  Answer<v1::Job> remove(const std::string& name) const;
  Answer<std::shared_ptr<EventLog>> events(const std::string& name) const;
  /// The mesh of a running job as an iteration has left it; null if it has shown none yet (EventLog::watch_mesh()).
  Answer<std::shared_ptr<const std::string>> watch_mesh(const std::string& name) const;

  // As MeshStore has them.
  Answer<UploadTicket> begin_upload(const std::string& id, const std::string& digest, std::int64_t size) const;
  Answer<std::int64_t> append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) const {
    return meshes_->append(ticket, offset, bytes);
  }
  /// For bytes that the caller sends.
  Answer<std::unique_ptr<BlobWriter>> create(std::int64_t announced) const { return meshes_->create(announced); }
  std::optional<std::int64_t> share() const { return meshes_->share_of(caller_.owner); }
  std::unique_ptr<KeptShare> keep_share() const { return meshes_->keep_share(caller_.owner); }
  Answer<StoredBytes> finish_upload(const UploadTicket& ticket) const { return meshes_->finish_upload(ticket); }
  Answer<UploadProgress> query_upload(const std::string& id, const std::string& digest) const;
  std::unique_ptr<BlobCheck> check(const std::string& digest) const {
    return may_use(digest) ? meshes_->check(digest) : nullptr;
  }
  Answer<std::unique_ptr<BlobReader>> read(const std::string& digest) const;
  /// FAILED_PRECONDITION if jobs of the caller refer to the mesh. If other owners have it too, they keep it.
  Answer<void> remove_mesh(const std::string& digest) const;
  /// The caller has sent all bytes of a mesh, which is referred to, and submits a job with it before let_go(). After
  /// that the mesh is the caller's as long as a job has it.
  void hold(const std::string& digest) const { scheduler_->hold(caller_.owner, digest); }
  void let_go(const std::string& digest) const { scheduler_->let_go(caller_.owner, digest); }

 private:
  /// The fields of a line of the log about what this caller does with a job.
  LogFields fields_about(const std::string& job) const;
  // As the methods without "try", which also write down what was done.
  Answer<v1::Job> try_submit(const std::string& request_id, const v1::JobSpec& spec, bool validate_only,
                             const TraceContext& trace) const;
  Answer<void> try_remove_mesh(const std::string& digest) const;
  /// NOT_FOUND unless the job is there for the caller.
  Answer<void> check_job(const std::string& name) const;
  bool may_use(const std::string& digest) const {
    return caller_.sees_all() || meshes_->belongs_to(digest, caller_.owner);
  }

  Scheduler* scheduler_;
  MeshStore* meshes_;
  Caller caller_;
};

}  // namespace varimesh::server
