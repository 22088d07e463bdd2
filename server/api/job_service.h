// JobService of the contract: submissions, states, events and results.
#pragma once

#include "server/api/stream_out.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Handles the calls of JobService. The calls are documented in service.proto.
class JobService : public v1::JobService::CallbackService {
 public:
  explicit JobService(const ApiContext& api);

 private:
  using Call = grpc::CallbackServerContext;
  using Request = grpc::ByteBuffer;
  template <class Response>
  using Stream = grpc::ServerWriteReactor<Response>;
  grpc::ServerUnaryReactor* submit(Call* call, const Request* request, v1::SubmitJobResponse* response);
  grpc::ServerUnaryReactor* get(Call* call, const Request* request, v1::GetJobResponse* response);
  grpc::ServerUnaryReactor* list(Call* call, const Request* request, v1::ListJobsResponse* response);
  grpc::ServerUnaryReactor* cancel(Call* call, const Request* request, v1::CancelJobResponse* response);
  grpc::ServerUnaryReactor* remove(Call* call, const Request* request, v1::DeleteJobResponse* response);
  Stream<v1::WatchJobResponse>* watch(Call* call, const Request* request);
  Stream<v1::GetResultResponse>* result(Call* call, const Request* request);
  grpc::ServerUnaryReactor* info(Call* call, const Request* request, v1::GetServerInfoResponse* response);

  /// Returns OUT_OF_RANGE if the watch cannot continue after the event that it asks for.
  grpc::Status check_resumption(const v1::WatchJobRequest& request, const EventLog& log);

  const ApiContext& api_;
};

}  // namespace varimesh::server
