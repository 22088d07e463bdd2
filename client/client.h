// libvarimesh-client: what a C++ program needs to have its meshes optimised by a server.
//
//   auto client = varimesh::client::Client::connect("127.0.0.1:50051");
//   auto mesh = client->upload_file("wing.msh");
//   varimesh::v1::JobSpec spec;
//   spec.mutable_mesh()->set_digest(mesh->digest());
//   auto job = client->submit(spec);
//   auto ended = client->watch(job->name(), 0, [](const varimesh::v1::JobEvent& event) { … return true; });
//   client->download(ended->results(0), "wing-optimised.msh");
#pragma once

#include <grpcpp/channel.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "varimesh/v1/service.grpc.pb.h"

namespace varimesh::client {

class InputFile;
class Interrupter;
class Patience;

/// Why a call did not do what it was asked to.
struct Failure {
  enum class Kind {
    Transport,    ///< The server is not there, or went away and did not come back.
    Refused,      ///< The server said no; `reason` says why.
    File,         ///< A local file cannot be read or written.
    Interrupted,  ///< The caller asked to stop.
  };
  Kind kind = Kind::Transport;
  std::string reason;    ///< Of google.rpc.ErrorInfo: MESH_NOT_FOUND; service.proto lists them.
  std::string sentence;  ///< What was wrong, where, and what to do.
  std::map<std::string, std::string> metadata;
};

template <class T>
using Outcome = tl::expected<T, Failure>;

/// How patient a client is.
struct Settings {
  std::chrono::milliseconds connect{5000};  ///< For the first contact.
  std::chrono::milliseconds retry{60000};   ///< For a server that was there and went away.
  /// Asked often, and from a thread of the client's own; true ends calls under way with Interrupted. Calls with one
  /// answer that begin afterwards (to cancel a job, say) are made once, and have `last_word` to be answered.
  std::function<bool()> interrupted;
  std::chrono::milliseconds last_word{2000};
  /// Meshes go compressed, where that makes them smaller: for a network of less than some hundred MB/s.
  bool compress = false;
  /// Told false as soon as a server that was there is found away, and true when it is back.
  std::function<void(bool answers)> on_contact;

  bool wants_to_stop() const { return interrupted && interrupted(); }
};

/// What came of a job that succeeded.
struct JobResult {
  v1::Job job;
  std::vector<v1::Iteration> history;
};

/// A connection to a server. Every call repeats itself while the server is unavailable; that is safe, because every
/// call of the contract is made to be repeated. All calls may come from any thread.
class Client {
 public:
  /// `bulk` carries the meshes, so that they do not hold up the rest; it may be the same channel.
  Client(const std::shared_ptr<grpc::Channel>& control, const std::shared_ptr<grpc::Channel>& bulk,
         Settings settings = {});
  /// HOST:PORT or unix:PATH, without encryption. Fails where nobody answers in `settings.connect`.
  static Outcome<Client> connect(const std::string& address, Settings settings = {});

  /// Brings a file to the server, unless it is there already; goes on where a broken upload stopped. A pipe or a device
  /// is read to its end first.
  Outcome<v1::StoredMesh> upload_file(const std::string& path);
  Outcome<v1::StoredMesh> upload(const InputFile& file);
  /// A request id of its own makes a repeated submission join the same job; empty: a random one.
  Outcome<v1::Job> submit(const v1::JobSpec& spec, std::string request_id = {}, bool validate_only = false);
  Outcome<v1::Job> get(const std::string& name);
  Outcome<v1::Job> cancel(const std::string& name);
  Outcome<void> remove(const std::string& name);
  /// All that match, newest first.
  Outcome<std::vector<v1::Job>> list(const v1::ListJobsRequest& filter);
  Outcome<v1::GetServerInfoResponse> info();

  /// Delivers the events after `after_sequence`, resuming by itself, until the job ends; returns the job as it ended.
  /// `on_event` returns false to stop watching. `on_wait` is called a few times a second in between, may call other
  /// methods (cancel, say), and returns false to stop at once, with Interrupted. Refused with BAD_OPTION where the job
  /// has no event of the number `after_sequence` yet.
  using OnEvent = std::function<bool(const v1::JobEvent&)>;
  Outcome<v1::Job> watch(const std::string& name, std::int64_t after_sequence, const OnEvent& on_event,
                         const std::function<bool()>& on_wait = {});

  Outcome<JobResult> result(const std::string& name);
  /// Writes the mesh beside `path`, compares its digest, and renames it (formats::OutputFile).
  Outcome<void> download(const v1::StoredMesh& mesh, const std::string& path);

 private:
  template <class Request, class Response>
  Outcome<Response> call(grpc::Status (v1::JobService::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                         const Request& request);
  /// One go at an upload: nothing where the call ended with `status` and may be repeated.
  Outcome<std::optional<v1::StoredMesh>> upload_once(const InputFile& file, const v1::UploadHeader& header,
                                                     std::int64_t* committed, Patience* patience, grpc::Status* status);

  std::shared_ptr<v1::JobService::Stub> jobs_;
  std::shared_ptr<v1::MeshService::Stub> meshes_;
  Settings settings_;
  std::shared_ptr<Interrupter> interrupter_;  ///< Null where nothing interrupts.
};

}  // namespace varimesh::client
