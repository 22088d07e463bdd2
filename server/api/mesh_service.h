// MeshService of the contract: uploads and downloads of meshes, which are named by their digests.
#pragma once

#include "server/api/stream_out.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Handles the calls of MeshService. The calls are documented in service.proto.
class MeshService : public v1::MeshService::CallbackService {
 public:
  explicit MeshService(const ApiContext& api) : api_(api) {}

  grpc::ServerReadReactor<v1::UploadMeshRequest>* UploadMesh(grpc::CallbackServerContext* call,
                                                             v1::UploadMeshResponse* response) override;
  grpc::ServerBidiReactor<v1::SendMeshRequest, v1::SendMeshResponse>* SendMesh(
      grpc::CallbackServerContext* call) override;
  grpc::ServerUnaryReactor* QueryUpload(grpc::CallbackServerContext* call, const v1::QueryUploadRequest* request,
                                        v1::QueryUploadResponse* response) override;
  grpc::ServerUnaryReactor* DeleteMesh(grpc::CallbackServerContext* call, const v1::DeleteMeshRequest* request,
                                       v1::DeleteMeshResponse* response) override;
  grpc::ServerWriteReactor<v1::DownloadMeshResponse>* DownloadMesh(grpc::CallbackServerContext* call,
                                                                   const v1::DownloadMeshRequest* request) override;

 private:
  const ApiContext& api_;
};

}  // namespace varimesh::server
