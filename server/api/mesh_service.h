// MeshService of the contract: uploads and downloads of meshes, which are named by their digests.
#pragma once

#include "server/api/stream_out.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Handles the calls of MeshService. The calls are documented in service.proto.
class MeshService : public v1::MeshService::CallbackService {
 public:
  explicit MeshService(const ApiContext& api);

  grpc::ServerReadReactor<v1::UploadMeshRequest>* UploadMesh(grpc::CallbackServerContext* call,
                                                             v1::UploadMeshResponse* response) override;
  grpc::ServerBidiReactor<v1::SendMeshRequest, v1::SendMeshResponse>* SendMesh(
      grpc::CallbackServerContext* call) override;

 private:
  using Call = grpc::CallbackServerContext;
  using Request = grpc::ByteBuffer;
  grpc::ServerUnaryReactor* query(Call* call, const Request* request, v1::QueryUploadResponse* response);
  grpc::ServerUnaryReactor* remove(Call* call, const Request* request, v1::DeleteMeshResponse* response);
  grpc::ServerWriteReactor<v1::DownloadMeshResponse>* download(Call* call, const Request* request);

  const ApiContext& api_;
};

}  // namespace varimesh::server
