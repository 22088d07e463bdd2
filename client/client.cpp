// Calls that answer once, and meshes in and out.
#include "client/client.h"

#include <grpcpp/grpcpp.h>

#include <array>
#include <cstdio>
#include <random>

#include "client/failures.h"
#include "client/frames.h"
#include "client/input_file.h"
#include "client/interrupter.h"
#include "core/base/sha256.h"
#include "core/formats/output_file.h"

namespace varimesh::client {
namespace {

constexpr std::size_t kChunkBytes = 256 * 1024, kMostChunkBytes = 1024 * 1024;
/// A chunk goes in pieces, so that one is on its way while another is stored.
constexpr std::int64_t kAheadBytes = kChunkBytes, kPieceBytes = kAheadBytes / 4;

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

tl::unexpected<Failure> interrupted(const char* when) {
  return tl::unexpected(Failure{Failure::Kind::Interrupted, "", std::string("Interrupted ") + when + ".", {}});
}

}  // namespace

Client::Client(const std::shared_ptr<grpc::Channel>& control, const std::shared_ptr<grpc::Channel>& bulk,
               Settings settings)
    : jobs_(v1::JobService::NewStub(control)),
      meshes_(v1::MeshService::NewStub(bulk)),
      settings_(std::move(settings)),
      interrupter_(settings_.interrupted ? std::make_shared<Interrupter>(settings_.interrupted) : nullptr) {}

Outcome<Client> Client::connect(const std::string& address, Settings settings) {
  const auto channel = [&](int number) {
    grpc::ChannelArguments arguments;
    // Equal channels would share one connection.
    arguments.SetInt("varimesh.channel", number);
    arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
    // A server that hangs, or that the network has lost, is noticed within 20 s; it takes a ping every 10 s.
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 15'000);
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5'000);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2'000);
    return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
  };
  const auto control = channel(1);
  const auto deadline = std::chrono::steady_clock::now() + settings.connect;
  while (!control->WaitForConnected(std::chrono::system_clock::now() + std::chrono::milliseconds(100))) {
    if (settings.wants_to_stop()) return interrupted("before the server answered");
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
  const bool last = settings_.wants_to_stop();
  while (true) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + (last ? settings_.last_word : std::chrono::seconds(30)));
    const Interrupter::Eye eye(last ? nullptr : interrupter_.get(), &context);
    Response response;
    const grpc::Status status = ((*jobs_).*method)(&context, request, &response);
    if (status.ok()) patience.reset();
    if (status.ok()) return response;
    if (patience.again(status)) continue;
    if (!last && settings_.wants_to_stop()) return interrupted("before the server answered");
    return tl::unexpected(failure_of(status));
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
    const Interrupter::Eye eye(interrupter_.get(), &context);
    const auto reader = jobs_->GetResult(&context, request);
    JobResult result;
    v1::GetResultResponse response;
    while (reader->Read(&response)) {
      if (response.has_job()) result.job = response.job();
      for (const v1::Iteration& iteration : response.history().iterations()) result.history.push_back(iteration);
    }
    const grpc::Status status = reader->Finish();
    if (status.ok()) patience.reset();
    if (status.ok()) return result;
    if (patience.again(status)) continue;
    if (settings_.wants_to_stop()) return interrupted("while the history was fetched");
    return tl::unexpected(failure_of(status));
  }
}

// ===== meshes =====

Outcome<v1::StoredMesh> Client::upload_file(const std::string& path) {
  const auto file = InputFile::open(path, settings_.interrupted);
  if (!file) return tl::unexpected(file.error());
  return upload(*file);
}

Outcome<v1::StoredMesh> Client::upload(const InputFile& file) {
  Sha256 digest;
  std::int64_t size = 0;
  while (true) {
    if (settings_.wants_to_stop()) return interrupted("while the mesh was read");
    const auto chunk = file.read(size, kChunkBytes);
    if (!chunk) return tl::unexpected(chunk.error());
    if (chunk->empty()) break;
    digest.update(*chunk);
    size += static_cast<std::int64_t>(chunk->size());
  }
  v1::UploadHeader header;
  header.set_upload_id(random_id());
  header.set_digest(digest.finish());
  header.set_size(size);

  Patience patience(settings_);
  std::int64_t committed = 0;
  while (true) {
    grpc::Status status;
    const auto stored = upload_once(file, header, &committed, &patience, &status);
    if (!stored) return tl::unexpected(stored.error());
    if (stored->has_value()) return **stored;
    if (settings_.wants_to_stop()) return interrupted("while the mesh was uploaded");
    if (!patience.again(status)) return tl::unexpected(failure_of(status));
  }
}

Outcome<std::optional<v1::StoredMesh>> Client::upload_once(const InputFile& file, const v1::UploadHeader& header,
                                                           std::int64_t* committed, Patience* patience,
                                                           grpc::Status* status) {
  grpc::ClientContext context;
  const Interrupter::Eye eye(interrupter_.get(), &context);
  const auto stream = meshes_->SendMesh(&context);
  v1::SendMeshRequest request;
  v1::SendMeshResponse response;
  std::optional<Failure> unreadable;
  // What the server has answers every message; nothing is sent beyond one chunk behind that.
  std::int64_t sent = 0;
  bool half_closed = false;
  *request.mutable_header() = header;
  for (bool open = stream->Write(request); open && stream->Read(&response) && !response.has_mesh();) {
    // A connection that breaks again and again is worth the full time as long as bytes arrive.
    if (response.committed_size() > *committed) patience->reset();
    *committed = response.committed_size();
    sent = std::max(sent, *committed);
    while (open && !unreadable && !half_closed && sent - *committed <= kAheadBytes - kPieceBytes) {
      auto piece = file.read(sent, kPieceBytes);
      if (!piece) {
        unreadable = piece.error();
        context.TryCancel();
      } else if (piece->empty()) {
        half_closed = true;  // also where the connection is gone: it may not be said twice
        open = stream->WritesDone();
      } else {
        request.mutable_chunk()->set_offset(sent);
        sent += static_cast<std::int64_t>(piece->size());
        std::string frame = settings_.compress ? compress(*piece) : std::string();
        request.mutable_chunk()->set_encoding(frame.empty() ? v1::ENCODING_UNSPECIFIED : v1::ENCODING_ZSTD);
        request.mutable_chunk()->set_data(std::move(frame.empty() ? *piece : frame));
        open = stream->Write(request);
      }
    }
  }
  *status = stream->Finish();
  if (unreadable) return tl::unexpected(*unreadable);
  if (!status->ok() || !response.has_mesh()) return std::nullopt;
  patience->reset();
  return response.mesh();
}

Outcome<void> Client::download(const v1::StoredMesh& mesh, const std::string& path) {
  auto file = formats::OutputFile::open(path);
  if (!file) return file_failure(file.error().sentence);
  Sha256 digest;
  v1::DownloadMeshRequest request;
  request.set_digest(mesh.digest());
  if (settings_.compress) request.set_encoding(v1::ENCODING_ZSTD);
  Patience patience(settings_);
  for (bool damaged = false; true;) {
    grpc::ClientContext context;
    const Interrupter::Eye eye(interrupter_.get(), &context);
    const auto reader = meshes_->DownloadMesh(&context, request);
    v1::DownloadMeshResponse response;
    std::string content;
    while (!file->failed() && !damaged && reader->Read(&response)) {
      const bool is_frame = response.chunk().encoding() == v1::ENCODING_ZSTD;
      damaged = is_frame && !expand(response.chunk().data(), kMostChunkBytes, &content);
      if (damaged) break;
      const std::string& bytes = is_frame ? content : response.chunk().data();
      file->write(bytes);
      digest.update(bytes);
      request.set_offset(request.offset() + static_cast<std::int64_t>(bytes.size()));
      patience.reset();
    }
    if (file->failed() || damaged) context.TryCancel();
    const grpc::Status status = reader->Finish();
    if (file->failed() || damaged || status.ok()) break;  // the digest tells
    if (patience.again(status)) continue;
    if (settings_.wants_to_stop()) return interrupted("while the result was fetched");
    return tl::unexpected(failure_of(status));
  }
  if (!file->failed() && digest.finish() != mesh.digest())
    return tl::unexpected(Failure{Failure::Kind::Transport,
                                  "DIGEST_MISMATCH",
                                  "The bytes that came are not those of the result; fetch it again.",
                                  {}});
  if (const auto done = file->commit(); !done) return file_failure(done.error().sentence);
  return {};
}

}  // namespace varimesh::client
