// A server with an engine of the tests, and the stubs to call it.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "core/base/sha256.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/server.h"
#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::server::testing {

/// Opens once, for all threads that wait.
class Gate {
 public:
  void open() {
    std::lock_guard lock(mutex_);
    open_ = true;
    opened_.notify_all();
  }
  void wait() {
    std::unique_lock lock(mutex_);
    opened_.wait(lock, [this] { return open_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable opened_;
  bool open_ = false;
};

/// An engine that returns its input after `iterations` iterations and calls `between` before each. Its checkpoints
/// contain the number of iterations done.
inline Engine echo_engine(
    int iterations = 3, std::function<void(int)> between = [](int) {}) {
  Engine engine;
  engine.check_options = [](const Options& options) -> Expected<void> {
    if (options.tolerance <= 0) return bad_option("The tolerance must be positive.");
    return {};
  };
  engine.run = [=](RunRequest request, const RunHooks& hooks) -> Expected<RunSummary> {
    const std::string bytes(request.input->bytes());
    if (bytes.rfind("bad", 0) == 0) return bad_input("Byte 0 is bad; send another mesh.");
    RunSummary outcome;
    const RunControl& control = hooks.control;
    const int done = control.checkpoint.empty() ? 0 : std::stoi(std::string(control.checkpoint));
    for (int i = 1; i <= iterations; ++i) {
      Iteration iteration;
      iteration.number = i;
      iteration.residual = 1.0 / i;
      outcome.history.push_back(iteration);
      outcome.iterations = i;
      if (i <= done) continue;
      between(i);
      if (control.checkpoint_due(iteration))
        control.save_checkpoint(iteration, [i](const CheckpointSink& sink) { return sink(std::to_string(i)); });
      if (hooks.on_iteration(iteration) == Control::Stop) {
        outcome.stopped = true;
        return outcome;
      }
    }
    outcome.converged = true;
    std::vector<v1::MeshFormat> outputs = request.outputs;
    if (outputs.empty()) outputs = {v1::MESH_FORMAT_MSH22};
    for (v1::MeshFormat format : outputs) {
      if (format == v1::MESH_FORMAT_UNSPECIFIED) format = v1::MESH_FORMAT_MSH22;
      const Sink sink = hooks.open_output(format);
      if (!sink(bytes)) return tl::unexpected(Error{Error::Kind::Output, "The sink is full."});
    }
    return outcome;
  };
  return engine;
}

inline ServerOptions options_with(Engine engine, std::string listen = "127.0.0.1:0") {
  ServerOptions options;
  options.listen = std::move(listen);
  options.engine = std::move(engine);
  options.limits.threads = 2;
  return options;
}

/// A running server, a channel to it, and its most frequent calls.
struct Service {
  explicit Service(ServerOptions options) {
    auto started = Server::start(std::move(options));
    if (!started) ADD_FAILURE() << started.error().sentence;
    use(std::move(*started));
  }
  /// Without a server; use() gives it one.
  Service() = default;

  void use(std::unique_ptr<Server> running) {
    server = std::move(running);
    channel = new_channel();
    jobs = v1::JobService::NewStub(channel);
    meshes = v1::MeshService::NewStub(channel);
  }
  explicit Service(Engine engine) : Service(options_with(std::move(engine))) {}

  std::shared_ptr<grpc::Channel> new_channel() const {
    static std::atomic<int> number = 0;
    grpc::ChannelArguments arguments;
    arguments.SetInt("test.channel", ++number);
    return grpc::CreateCustomChannel(server->address(), grpc::InsecureChannelCredentials(), arguments);
  }

  /// Uploads a mesh in chunks and returns its digest.
  std::string upload(const std::string& bytes, std::size_t chunk = 1000) const {
    v1::UploadMeshRequest request;
    request.mutable_header()->set_digest(sha256(bytes));
    request.mutable_header()->set_upload_id("upload of " + request.header().digest());
    request.mutable_header()->set_size(static_cast<std::int64_t>(bytes.size()));
    const std::string digest = request.header().digest();
    grpc::ClientContext context;
    v1::UploadMeshResponse response;
    const auto writer = meshes->UploadMesh(&context, &response);
    bool open = writer->Write(request);
    for (std::size_t at = 0; open && at < bytes.size(); at += chunk) {
      request.mutable_chunk()->set_offset(static_cast<std::int64_t>(at));
      request.mutable_chunk()->set_data(bytes.substr(at, chunk));
      open = writer->Write(request);
    }
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return digest;
  }

  v1::JobSpec spec_for(const std::string& bytes) const {
    v1::JobSpec spec;
    spec.mutable_mesh()->set_digest(upload(bytes));
    return spec;
  }

  grpc::Status submit(const std::string& request_id, const v1::JobSpec& spec, v1::Job* job,
                      bool validate = false) const {
    grpc::ClientContext context;
    v1::SubmitJobRequest request;
    request.set_request_id(request_id);
    *request.mutable_spec() = spec;
    request.set_validate_only(validate);
    v1::SubmitJobResponse response;
    const grpc::Status status = jobs->SubmitJob(&context, request, &response);
    *job = response.job();
    return status;
  }
  v1::Job submit(const v1::JobSpec& spec) const {
    v1::Job job;
    const grpc::Status status = submit("", spec, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return job;
  }
  v1::Job cancel(const std::string& name) const {
    grpc::ClientContext context;
    v1::CancelJobRequest request;
    request.set_name(name);
    v1::CancelJobResponse response;
    EXPECT_TRUE(jobs->CancelJob(&context, request, &response).ok());
    return response.job();
  }

  /// Returns the events of a job until the stream ends, or until there are `most`.
  std::vector<v1::JobEvent> watch(const std::string& name, std::int64_t after = 0, std::size_t most = 1'000'000,
                                  grpc::Status* ended = nullptr) const {
    grpc::ClientContext context;
    v1::WatchJobRequest request;
    request.set_name(name);
    request.set_after_sequence(after);
    const auto reader = jobs->WatchJob(&context, request);
    std::vector<v1::JobEvent> events;
    v1::WatchJobResponse response;
    while (events.size() < most && reader->Read(&response)) events.push_back(response.event());
    if (events.size() == most) context.TryCancel();
    const grpc::Status status = reader->Finish();
    if (ended != nullptr) *ended = status;
    return events;
  }
  v1::Job get(const std::string& name) const {
    grpc::ClientContext context;
    v1::GetJobRequest request;
    request.set_name(name);
    v1::GetJobResponse response;
    EXPECT_TRUE(jobs->GetJob(&context, request, &response).ok());
    return response.job();
  }
  v1::Job wait_for(const std::string& name) const {
    watch(name);
    return get(name);
  }
  std::string download(const std::string& digest, std::int64_t offset = 0) const {
    grpc::ClientContext context;
    v1::DownloadMeshRequest request;
    request.set_digest(digest);
    request.set_offset(offset);
    const auto reader = meshes->DownloadMesh(&context, request);
    std::string bytes;
    v1::DownloadMeshResponse response;
    while (reader->Read(&response)) bytes += response.chunk().data();
    EXPECT_TRUE(reader->Finish().ok());
    return bytes;
  }

  std::unique_ptr<Server> server;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::JobService::Stub> jobs;
  std::unique_ptr<v1::MeshService::Stub> meshes;
};

/// Returns the ErrorInfo of a status.
inline google::rpc::ErrorInfo info_of(const grpc::Status& status) {
  google::rpc::Status full;
  google::rpc::ErrorInfo info;
  if (full.ParseFromString(status.error_details()))
    for (const auto& detail : full.details())
      if (detail.UnpackTo(&info)) return info;
  return info;
}

}  // namespace varimesh::server::testing
