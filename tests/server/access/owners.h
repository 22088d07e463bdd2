// Two owners and an admin on one server, for tests of what is there for whom.
#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "tests/server/service.h"

namespace varimesh::server::testing {

inline constexpr const char* kAnn = "token-of-ann";
inline constexpr const char* kBob = "token-of-bob";
inline constexpr const char* kReader = "token-of-reader";
inline constexpr const char* kSubmitter = "token-of-submitter";
inline constexpr const char* kOperator = "token-of-operator";

/// Returns the answer of a unary call with a token.
template <class Stub, class Request, class Response>
grpc::Status call_as(const std::string& token, Stub& stub,
                     grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                     const Request& request, Response* response) {
  grpc::ClientContext context;
  if (!token.empty()) context.AddMetadata("authorization", "Bearer " + token);
  return (stub.*method)(&context, request, response);
}

class Owners : public ::testing::Test {
 protected:
  Owners() {
    std::string name = ::testing::TempDir() + "varimesh-owners-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    std::ofstream tokens(folder_ / "tokens");
    for (const auto& [owner, roles, token] : {std::tuple{"ann", "submit,read,cancel", kAnn},
                                              {"bob", "submit,read,cancel", kBob},
                                              {"ann", "read", kReader},
                                              {"ann", "submit", kSubmitter},
                                              {"operator", "admin", kOperator}})
      tokens << owner << ' ' << roles << ' ' << sha256(token) << '\n';
    tokens.close();
    start();
  }
  ~Owners() override {
    gate_.open();
    service_.reset();
    std::filesystem::remove_all(folder_);
  }

  void start() {
    service_.reset();
    ServerOptions options = options_with(echo_engine(3, [this](int) { gate_.wait(); }));
    options.tokens = (folder_ / "tokens").string();
    options.state = (folder_ / "state").string();
    service_ = std::make_unique<Service>(std::move(options));
  }

  grpc::Status submit(const std::string& token, const std::string& digest, v1::Job* job,
                      const std::string& request_id = "") {
    v1::SubmitJobRequest request;
    request.set_request_id(request_id);
    request.mutable_spec()->mutable_mesh()->set_digest(digest);
    (*request.mutable_spec()->mutable_labels())["case"] = "wing";
    v1::SubmitJobResponse response;
    const auto status = call_as(token, *service_->jobs, &v1::JobService::Stub::SubmitJob, request, &response);
    *job = response.job();
    return status;
  }
  grpc::Status get(const std::string& token, const std::string& name, v1::Job* job) {
    v1::GetJobRequest request;
    request.set_name(name);
    v1::GetJobResponse response;
    const auto status = call_as(token, *service_->jobs, &v1::JobService::Stub::GetJob, request, &response);
    *job = response.job();
    return status;
  }
  /// One job of a caller, and the token of the next page.
  grpc::Status page(const std::string& token, const std::string& page_token, v1::ListJobsResponse* response) {
    v1::ListJobsRequest request;
    request.set_page_size(1);
    request.set_page_token(page_token);
    return call_as(token, *service_->jobs, &v1::JobService::Stub::ListJobs, request, response);
  }
  std::vector<std::string> list(const std::string& token, bool labelled = true) {
    v1::ListJobsRequest request;
    if (labelled) (*request.mutable_labels())["case"] = "wing";
    v1::ListJobsResponse response;
    EXPECT_TRUE(call_as(token, *service_->jobs, &v1::JobService::Stub::ListJobs, request, &response).ok());
    std::vector<std::string> names;
    for (const v1::Job& job : response.jobs()) names.push_back(job.name());
    return names;
  }
  /// Begins an upload and returns how many bytes the server already has; `size`: it has the mesh. Sends the rest.
  std::int64_t upload(const std::string& token, const std::string& bytes, const std::string& id = "upload") {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + token);
    const auto stream = service_->meshes->SendMesh(&context);
    v1::SendMeshRequest request;
    request.mutable_header()->set_digest(sha256(bytes));
    request.mutable_header()->set_upload_id(id);
    request.mutable_header()->set_size(static_cast<std::int64_t>(bytes.size()));
    stream->Write(request);
    v1::SendMeshResponse response;
    std::int64_t had = -1;
    if (stream->Read(&response)) had = response.has_mesh() ? response.mesh().size() : response.committed_size();
    if (!response.has_mesh() && had >= 0) {
      request.mutable_chunk()->set_offset(had);
      request.mutable_chunk()->set_data(bytes.substr(static_cast<std::size_t>(had)));
      stream->Write(request);
    }
    stream->WritesDone();
    while (stream->Read(&response)) continue;
    EXPECT_TRUE(stream->Finish().ok());
    return had;
  }
  grpc::Status download(const std::string& token, const std::string& digest, std::string* bytes) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + token);
    v1::DownloadMeshRequest request;
    request.set_digest(digest);
    const auto reader = service_->meshes->DownloadMesh(&context, request);
    v1::DownloadMeshResponse response;
    while (reader->Read(&response)) *bytes += response.chunk().data();
    return reader->Finish();
  }
  /// Sends a mesh and submits its job in one call, and waits for its end.
  grpc::Status optimise_mesh(const std::string& token, const std::string& bytes, v1::Job* job) {
    const auto stub = v1::OptimiseService::NewStub(service_->channel);
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + token);
    const auto stream = stub->Optimise(&context);
    v1::OptimiseRequest request;
    request.mutable_spec()->set_size(static_cast<std::int64_t>(bytes.size()));
    stream->Write(request);
    request.mutable_chunk()->set_data(bytes);
    stream->Write(request);
    stream->WritesDone();
    v1::OptimiseResponse response;
    while (stream->Read(&response))
      if (response.has_accepted()) *job = response.accepted();
    return stream->Finish();
  }
  grpc::Status watch(const std::string& token, const std::string& name) {
    grpc::ClientContext context;
    context.AddMetadata("authorization", "Bearer " + token);
    v1::WatchJobRequest request;
    request.set_name(name);
    const auto reader = service_->jobs->WatchJob(&context, request);
    v1::WatchJobResponse response;
    while (reader->Read(&response)) continue;
    return reader->Finish();
  }
  template <class Request, class Response>
  grpc::Status about(const std::string& token, const std::string& name,
                     grpc::Status (v1::JobService::Stub::*method)(grpc::ClientContext*, const Request&, Response*)) {
    Request request;
    request.set_name(name);
    Response response;
    return call_as(token, *service_->jobs, method, request, &response);
  }
  grpc::Status cancel(const std::string& token, const std::string& name) {
    return about(token, name, &v1::JobService::Stub::CancelJob);
  }
  grpc::Status remove(const std::string& token, const std::string& name) {
    return about(token, name, &v1::JobService::Stub::DeleteJob);
  }
  grpc::Status remove_mesh(const std::string& token, const std::string& digest) {
    v1::DeleteMeshRequest request;
    request.set_digest(digest);
    v1::DeleteMeshResponse response;
    return call_as(token, *service_->meshes, &v1::MeshService::Stub::DeleteMesh, request, &response);
  }
  std::string query(const std::string& token, const std::string& id, const std::string& digest) {
    v1::QueryUploadRequest request;
    request.set_upload_id(id);
    request.set_digest(digest);
    v1::QueryUploadResponse response;
    const auto status = call_as(token, *service_->meshes, &v1::MeshService::Stub::QueryUpload, request, &response);
    return !status.ok() ? info_of(status).reason() : response.complete() ? "complete" : "begun";
  }

  std::filesystem::path folder_;
  Gate gate_;
  std::unique_ptr<Service> service_;
};

}  // namespace varimesh::server::testing
