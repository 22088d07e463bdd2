// JobService of the contract: submissions, states, events and results.
#pragma once

#include "server/api/stream_out.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Handles the calls of JobService. The calls are documented in service.proto.
class JobService : public v1::JobService::CallbackService {
 public:
  explicit JobService(const ApiContext& api) : api_(api) {}

  grpc::ServerUnaryReactor* SubmitJob(grpc::CallbackServerContext* call, const v1::SubmitJobRequest* request,
                                      v1::SubmitJobResponse* response) override;
  grpc::ServerUnaryReactor* GetJob(grpc::CallbackServerContext* call, const v1::GetJobRequest* request,
                                   v1::GetJobResponse* response) override;
  grpc::ServerUnaryReactor* ListJobs(grpc::CallbackServerContext* call, const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override;
  grpc::ServerUnaryReactor* CancelJob(grpc::CallbackServerContext* call, const v1::CancelJobRequest* request,
                                      v1::CancelJobResponse* response) override;
  grpc::ServerUnaryReactor* DeleteJob(grpc::CallbackServerContext* call, const v1::DeleteJobRequest* request,
                                      v1::DeleteJobResponse* response) override;
  grpc::ServerWriteReactor<v1::WatchJobResponse>* WatchJob(grpc::CallbackServerContext* call,
                                                           const v1::WatchJobRequest* request) override;
  grpc::ServerWriteReactor<v1::GetResultResponse>* GetResult(grpc::CallbackServerContext* call,
                                                             const v1::GetResultRequest* request) override;
  grpc::ServerUnaryReactor* GetServerInfo(grpc::CallbackServerContext* call, const v1::GetServerInfoRequest* request,
                                          v1::GetServerInfoResponse* response) override;

 private:
  /// Returns OUT_OF_RANGE if the watch cannot continue after the event that it asks for.
  grpc::Status check_resumption(const v1::WatchJobRequest& request, const EventLog& log);

  const ApiContext& api_;
};

}  // namespace varimesh::server
