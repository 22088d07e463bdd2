// The table, and how an address is found in it.
#include "server/http/routes.h"

#include <optional>

#include "server/http/listen.h"

namespace varimesh::server {
namespace {

constexpr std::string_view kEventsType = "text/event-stream", kJobs = "varimesh.v1.JobService",
                           kMeshes = "varimesh.v1.MeshService";

const std::vector<QueryField> kUpload = {{"digest", "UploadHeader", "digest", true},
                                         {"uploadId", "UploadHeader", "upload_id"},
                                         {"offset", "Chunk", "offset"}};

/// What stands for {…} in the path; empty if the pattern has none. Nothing: the path is another one.
std::optional<std::string> match(std::string_view pattern, std::string_view path) {
  const auto open = pattern.find('{');
  if (open == std::string_view::npos) return pattern == path ? std::optional(std::string()) : std::nullopt;
  const std::string_view before = pattern.substr(0, open), after = pattern.substr(pattern.find('}') + 1);
  if (path.size() <= before.size() + after.size() || !path.starts_with(before) || !path.ends_with(after))
    return std::nullopt;
  const std::string_view id = path.substr(before.size(), path.size() - before.size() - after.size());
  return id.find('/') == std::string_view::npos ? std::optional(std::string(id)) : std::nullopt;
}

}  // namespace

std::span<const Route> routes() {
  using To = Route::To;
  static const std::vector<Route> table = {
      {To::Info, "GET", "/v1/info", Method::GetServerInfo, kJobs, "GetServerInfo", {}, kJsonType, {}},
      {To::Document, "GET", "/v1/openapi.json", Method::GetServerInfo, "", "", {}, kJsonType, {}},
      {To::List,
       "GET",
       "/v1/jobs",
       Method::ListJobs,
       kJobs,
       "ListJobs",
       {},
       kJsonType,
       {{"states", "ListJobsRequest", "states"},
        {"labels.", "ListJobsRequest", "labels"},
        {"pageSize", "ListJobsRequest", "page_size"},
        {"pageToken", "ListJobsRequest", "page_token"}}},
      {To::Submit,
       "POST",
       "/v1/jobs",
       Method::SubmitJob,
       kJobs,
       "SubmitJob",
       {kJsonType, kFormType},
       kJsonType,
       {{"requestId", "SubmitJobRequest", "request_id"}, {"validateOnly", "SubmitJobRequest", "validate_only"}}},
      {To::Get, "GET", "/v1/jobs/{job}", Method::GetJob, kJobs, "GetJob", {}, kJsonType, {}},
      {To::Delete, "DELETE", "/v1/jobs/{job}", Method::DeleteJob, kJobs, "DeleteJob", {}, kJsonType, {}},
      {To::Cancel, "POST", "/v1/jobs/{job}/cancel", Method::CancelJob, kJobs, "CancelJob", {}, kJsonType, {}},
      {To::Events,
       "GET",
       "/v1/jobs/{job}/events",
       Method::WatchJob,
       kJobs,
       "WatchJob",
       {},
       kEventsType,
       {{"after", "WatchJobRequest", "after_sequence"}, {"minInterval", "WatchJobRequest", "min_interval"}}},
      {To::Result,
       "GET",
       "/v1/jobs/{job}/result",
       Method::DownloadMesh,
       kMeshes,
       "DownloadMesh",
       {},
       kBytesType,
       {{"format", "StoredMesh", "format"}}},
      {To::Mesh, "GET", "/v1/jobs/{job}/mesh", Method::DownloadMesh, kMeshes, "DownloadMesh", {}, kBytesType, {}},
      {To::SendMesh, "POST", "/v1/meshes", Method::SendMesh, kMeshes, "SendMesh", {kBytesType}, kJsonType, kUpload},
      {To::SendMesh, "PUT", "/v1/meshes", Method::SendMesh, kMeshes, "SendMesh", {kBytesType}, kJsonType, kUpload},
      {To::QueryUpload,
       "GET",
       "/v1/uploads/{upload}",
       Method::QueryUpload,
       kMeshes,
       "QueryUpload",
       {},
       kJsonType,
       {{"digest", "QueryUploadRequest", "digest", true}}},
  };
  return table;
}

Routed route(std::string_view method, std::string_view path) {
  Routed found;
  for (const Route& one : routes()) {
    auto id = match(one.path, path);
    if (!id) continue;
    found.methods += (found.methods.empty() ? "" : ", ") + std::string(one.method);
    if (one.method != method) continue;
    found.route = &one;
    found.id = std::move(*id);
  }
  return found;
}

}  // namespace varimesh::server
