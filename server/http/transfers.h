// The bytes of meshes and results over HTTP: uploads, which may be resumed, and downloads of any range.
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

/// Makes a job of a form (multipart/form-data) with the part spec, a JobSpec as JSON, and then the part mesh, the bytes
/// of the file, which are passed on as they come. If the spec has a digest, the mesh must have it. Answers with the
/// job.
void receive_job(HttpExchange& exchange, v1::OptimiseService::Stub& optimise, const std::string& request_id);

/// Answers with the bytes of a result of the job, or with the bytes that the header Range names. The query may name the
/// format of the result; otherwise the job must have exactly one result.
void send_result(HttpExchange& exchange, v1::JobService::Stub& jobs, v1::MeshService::Stub& meshes,
                 const std::string& job);

/// Answers with what a running job has shown of its mesh (DownloadMeshRequest.job), or with 204 if there is nothing to
/// see.
void send_mesh_of(HttpExchange& exchange, v1::MeshService::Stub& meshes, const std::string& job);

}  // namespace varimesh::server
