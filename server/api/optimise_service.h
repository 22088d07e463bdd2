// OptimiseService of the contract: upload, job and result in one call.
#pragma once

#include "server/api/context.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Handles the call Optimise, which uses the mesh store and the scheduler like the other services do.
class OptimiseService : public v1::OptimiseService::CallbackService {
 public:
  explicit OptimiseService(const ApiContext& api);

 private:
  grpc::ServerBidiReactor<grpc::ByteBuffer, v1::OptimiseResponse>* optimise(grpc::CallbackServerContext* call);

  const ApiContext& api_;
};

}  // namespace varimesh::server
