// MeshService of the contract: uploads and downloads of meshes, which are named by their digests.
#pragma once

#include "server/api/stream_out.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Handles the calls of MeshService. The calls are documented in service.proto.
class MeshService : public v1::MeshService::CallbackService {
 public:
  explicit MeshService(const ApiContext& api);

 private:
  using Call = grpc::CallbackServerContext;
  using Request = grpc::ByteBuffer;
  grpc::ServerReadReactor<Request>* upload(Call* call, v1::UploadMeshResponse* response);
  grpc::ServerBidiReactor<Request, v1::SendMeshResponse>* send(Call* call);
  grpc::ServerUnaryReactor* query(Call* call, const Request* request, v1::QueryUploadResponse* response);
  grpc::ServerUnaryReactor* remove(Call* call, const Request* request, v1::DeleteMeshResponse* response);
  grpc::ServerWriteReactor<v1::DownloadMeshResponse>* download(Call* call, const Request* request);

  const ApiContext& api_;
};

}  // namespace varimesh::server
