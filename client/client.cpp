// Calls that answer once, and meshes in and out.
#include "client/client.h"

#include <fcntl.h>
#include <grpcpp/grpcpp.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <random>

#include "client/digest.h"
#include "client/failures.h"

namespace varimesh::client {
namespace {

constexpr std::size_t kChunkBytes = 256 * 1024;

std::string random_id() {
  std::random_device device;
  std::string id;
  for (int i = 0; i < 4; ++i) {
    std::array<char, 9> digits{};
    std::snprintf(digits.data(), digits.size(), "%08x", static_cast<unsigned>(device()));
    id += digits.data();
  }
  return id;
}

/// Reads a file in chunks; false from `take` stops. The error is empty where all went well.
std::string read_file(const std::string& path, std::int64_t offset,
                      const std::function<bool(std::int64_t, std::string&)>& take) {
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path))
    return "The file '" + path + "' cannot be read (" + std::strerror(errno != 0 ? errno : EISDIR) +
           "); check its name and its permissions.";
  file.seekg(offset);
  std::string chunk;
  while (true) {
    chunk.resize(kChunkBytes);
    file.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
    chunk.resize(static_cast<std::size_t>(file.gcount()));
    if (chunk.empty()) return "";
    const auto size = static_cast<std::int64_t>(chunk.size());
    if (!take(offset, chunk)) return "";
    offset += size;
  }
}

/// A file written beside its place, which takes it over or goes without a trace.
class FileBeside {
 public:
  explicit FileBeside(const std::string& path) : path_(path), beside_(path + ".part-" + random_id().substr(0, 8)) {
    file_ = ::open(beside_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
    failed_ = file_ < 0;
  }
  ~FileBeside() {
    if (file_ >= 0) ::close(file_);
    if (!renamed_) ::unlink(beside_.c_str());
  }
  void write(std::string_view bytes) {
    while (!failed_ && !bytes.empty()) {
      const ssize_t written = ::write(file_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      failed_ = written <= 0;
      if (!failed_) bytes.remove_prefix(static_cast<std::size_t>(written));
    }
  }
  bool failed() const { return failed_; }
  bool commit() {
    if (failed_ || ::close(std::exchange(file_, -1)) != 0) return false;
    renamed_ = std::rename(beside_.c_str(), path_.c_str()) == 0;
    return renamed_;
  }

 private:
  const std::string path_, beside_;
  int file_ = -1;
  bool failed_ = false;
  bool renamed_ = false;
};

}  // namespace

Client::Client(std::shared_ptr<grpc::Channel> control, std::shared_ptr<grpc::Channel> bulk, Settings settings)
    : jobs_(v1::JobService::NewStub(control)),
      meshes_(v1::MeshService::NewStub(bulk)),
      settings_(std::move(settings)) {}

Outcome<Client> Client::connect(const std::string& address, Settings settings) {
  const auto channel = [&](int number) {
    grpc::ChannelArguments arguments;
    // Equal channels would share one connection.
    arguments.SetInt("varimesh.channel", number);
    arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 30'000);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2'000);
    return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
  };
  const auto control = channel(1);
  const auto deadline = std::chrono::steady_clock::now() + settings.connect;
  while (!control->WaitForConnected(std::chrono::system_clock::now() + std::chrono::milliseconds(100))) {
    if (settings.interrupted())
      return tl::unexpected(Failure{Failure::Kind::Interrupted, "", "Interrupted before the server answered.", {}});
    if (std::chrono::steady_clock::now() > deadline)
      return tl::unexpected(Failure{Failure::Kind::Transport,
                                    "",
                                    "There is no server at " + address + "; start varimeshd there, or name another.",
                                    {}});
  }
  return Client(control, channel(2), std::move(settings));
}

// ===== one request, one answer =====

template <class Request, class Response>
Outcome<Response> Client::call(grpc::Status (v1::JobService::Stub::*method)(grpc::ClientContext*, const Request&,
                                                                            Response*),
                               const Request& request) {
  Patience patience(settings_);
  while (true) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    Response response;
    const grpc::Status status = ((*jobs_).*method)(&context, request, &response);
    if (status.ok()) return response;
    if (!patience.again(status)) return tl::unexpected(failure_of(status));
  }
}

Outcome<v1::Job> Client::submit(const v1::JobSpec& spec, std::string request_id, bool validate_only) {
  v1::SubmitJobRequest request;
  request.set_request_id(request_id.empty() ? random_id() : std::move(request_id));
  *request.mutable_spec() = spec;
  request.set_validate_only(validate_only);
  return call(&v1::JobService::Stub::SubmitJob, request).map([](auto&& response) { return response.job(); });
}

Outcome<v1::Job> Client::get(const std::string& name) {
  v1::GetJobRequest request;
  request.set_name(name);
  return call(&v1::JobService::Stub::GetJob, request).map([](auto&& response) { return response.job(); });
}

Outcome<v1::Job> Client::cancel(const std::string& name) {
  v1::CancelJobRequest request;
  request.set_name(name);
  return call(&v1::JobService::Stub::CancelJob, request).map([](auto&& response) { return response.job(); });
}

Outcome<void> Client::remove(const std::string& name) {
  v1::DeleteJobRequest request;
  request.set_name(name);
  return call(&v1::JobService::Stub::DeleteJob, request).map([](auto&&) {});
}

Outcome<std::vector<v1::Job>> Client::list(const v1::ListJobsRequest& filter) {
  std::vector<v1::Job> jobs;
  v1::ListJobsRequest request = filter;
  do {
    auto page = call(&v1::JobService::Stub::ListJobs, request);
    if (!page) return tl::unexpected(page.error());
    for (v1::Job& job : *page->mutable_jobs()) jobs.push_back(std::move(job));
    request.set_page_token(page->next_page_token());
  } while (!request.page_token().empty());
  return jobs;
}

Outcome<v1::GetServerInfoResponse> Client::info() {
  return call(&v1::JobService::Stub::GetServerInfo, v1::GetServerInfoRequest());
}

Outcome<JobResult> Client::result(const std::string& name) {
  v1::GetResultRequest request;
  request.set_name(name);
  request.set_without_meshes(true);
  Patience patience(settings_);
  while (true) {
    grpc::ClientContext context;
    const auto reader = jobs_->GetResult(&context, request);
    JobResult result;
    v1::GetResultResponse response;
    while (reader->Read(&response)) {
      if (response.has_job()) result.job = response.job();
      for (const v1::Iteration& iteration : response.history().iterations()) result.history.push_back(iteration);
    }
    const grpc::Status status = reader->Finish();
    if (status.ok()) return result;
    if (!patience.again(status)) return tl::unexpected(failure_of(status));
  }
}

// ===== meshes =====

Outcome<v1::StoredMesh> Client::upload_file(const std::string& path) {
  Digest digest;
  std::int64_t size = 0;
  const std::string unreadable = read_file(path, 0, [&](std::int64_t, std::string& chunk) {
    digest.update(chunk);
    size += static_cast<std::int64_t>(chunk.size());
    return !settings_.interrupted();
  });
  if (!unreadable.empty()) return file_failure(unreadable);

  v1::UploadMeshRequest header;
  header.mutable_header()->set_upload_id(random_id());
  header.mutable_header()->set_digest(digest.finish());
  header.mutable_header()->set_size(size);
  v1::QueryUploadRequest query;
  query.set_upload_id(header.header().upload_id());
  query.set_digest(header.header().digest());

  Patience patience(settings_);
  while (!settings_.interrupted()) {
    std::int64_t offset = 0;
    {
      grpc::ClientContext context;
      v1::QueryUploadResponse known;
      const grpc::Status status = meshes_->QueryUpload(&context, query, &known);
      if (patience.again(status)) continue;
      if (!status.ok() && status.error_code() != grpc::StatusCode::NOT_FOUND) return tl::unexpected(failure_of(status));
      offset = known.committed_size();
      if (known.complete()) {
        v1::StoredMesh stored;
        stored.set_digest(query.digest());
        stored.set_size(size);
        return stored;
      }
    }
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = meshes_->UploadMesh(&context, &response);
    bool open = writer->Write(header);
    v1::UploadMeshRequest request;
    const std::string broken = read_file(path, offset, [&](std::int64_t at, std::string& chunk) {
      request.mutable_chunk()->set_offset(at);
      request.mutable_chunk()->mutable_data()->swap(chunk);
      open = open && !settings_.interrupted() && writer->Write(request);
      if (open && at == offset) patience.reset();
      return open;
    });
    if (!broken.empty() || settings_.interrupted()) context.TryCancel();
    if (open) writer->WritesDone();
    const grpc::Status status = writer->Finish();
    if (!broken.empty()) return file_failure(broken);
    if (status.ok()) return response.mesh();
    if (!settings_.interrupted() && !patience.again(status)) return tl::unexpected(failure_of(status));
  }
  return tl::unexpected(Failure{Failure::Kind::Interrupted, "", "Interrupted while the mesh was uploaded.", {}});
}

Outcome<void> Client::download(const v1::StoredMesh& mesh, const std::string& path) {
  FileBeside file(path);
  Digest digest;
  v1::DownloadMeshRequest request;
  request.set_digest(mesh.digest());
  Patience patience(settings_);
  while (true) {
    grpc::ClientContext context;
    const auto reader = meshes_->DownloadMesh(&context, request);
    v1::DownloadMeshResponse response;
    while (!file.failed() && reader->Read(&response)) {
      file.write(response.chunk().data());
      digest.update(response.chunk().data());
      request.set_offset(request.offset() + static_cast<std::int64_t>(response.chunk().data().size()));
      patience.reset();
      if (settings_.interrupted()) break;
    }
    if (file.failed() || settings_.interrupted()) context.TryCancel();
    const grpc::Status status = reader->Finish();
    if (file.failed()) break;
    if (settings_.interrupted())
      return tl::unexpected(Failure{Failure::Kind::Interrupted, "", "Interrupted while the result was fetched.", {}});
    if (status.ok()) break;
    if (!patience.again(status)) return tl::unexpected(failure_of(status));
  }
  if (!file.failed() && digest.finish() != mesh.digest())
    return tl::unexpected(Failure{Failure::Kind::Transport,
                                  "DIGEST_MISMATCH",
                                  "The bytes that came are not those of the result; fetch it again.",
                                  {}});
  if (!file.commit())
    return file_failure("The file '" + path + "' cannot be written (" + std::strerror(errno) +
                        "); free disk space or name another one.");
  return {};
}

}  // namespace varimesh::client
