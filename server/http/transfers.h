// The bytes of meshes and results over HTTP: uploads, which may be resumed, and downloads from any byte.
#pragma once

#include <string>

#include "server/http/exchange.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server {

/// Sends the body of the request to SendMesh, and answers with the mesh. The query has its digest, and may have
/// uploadId and offset: which upload it continues, and at which byte the body begins.
void receive_mesh(HttpExchange& exchange, v1::MeshService::Stub& meshes);

/// Answers with how far an upload has come.
void tell_upload(HttpExchange& exchange, v1::MeshService::Stub& meshes, const std::string& id);

/// Answers with the bytes of a result of the job, or with those from a byte on that the header Range names. The query
/// may have its format; without it the job must have one result.
void send_result(HttpExchange& exchange, v1::JobService::Stub& jobs, v1::MeshService::Stub& meshes,
                 const std::string& job);

}  // namespace varimesh::server
