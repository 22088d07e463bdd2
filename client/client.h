// libvarimesh-client: lets a C++ program have its meshes optimised by a server.
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
class MeshExchange;
class RetryPolicy;

/// Why a call failed.
struct Failure {
  enum class Kind {
    Transport,    ///< The server cannot be reached, or went away and did not come back.
    Refused,      ///< The server refused the call; `reason` says why.
    File,         ///< A local file cannot be read or written.
    Interrupted,  ///< The caller asked to stop.
  };
  Kind kind = Kind::Transport;
  std::string reason;    ///< The reason in google.rpc.ErrorInfo, such as MESH_NOT_FOUND; service.proto lists them.
  std::string sentence;  ///< What was wrong, where, and what to do.
  std::map<std::string, std::string> metadata;  ///< The metadata in google.rpc.ErrorInfo.
};

template <class T>
using Outcome = tl::expected<T, Failure>;

/// What a client shows to a server that asks who calls, and how it knows the server. The files are in PEM.
struct Credentials {
  std::string token;  ///< Sent with every call. Empty: none. Use it only where nobody else can read the connection.
  std::string token_file;  ///< If `token` is empty: a file that contains the token. Empty: none.
  /// A file with the authority that the server's certificate must come from. If it is given, or the address begins with
  /// https://, the connection is encrypted. Empty: the authorities of this machine.
  std::string authority;
  std::string certificate;  ///< A file with the client's certificate, for servers that ask for one. Empty: none.
  std::string key;          ///< A file with the private key of the certificate.
};

/// Returns the credentials in the environment variables VARIMESH_TOKEN, VARIMESH_TOKEN_FILE, VARIMESH_TLS_AUTHORITY,
/// VARIMESH_TLS_CERTIFICATE and VARIMESH_TLS_KEY.
Credentials credentials_from_environment();

/// How a client waits, stops and sends.
struct Settings {
  std::chrono::milliseconds connect{5000};  ///< For the first contact; where nobody listens, a second.
  std::chrono::milliseconds retry{60000};   ///< How long to wait for a server that was there and went away.
  /// Called several times per second, from a thread of the client too. If it returns true, calls under way end with
  /// Interrupted. A call with a single answer that begins afterwards (for example cancel()) is tried once, for at most
  /// `last_word`.
  std::function<bool()> interrupted;
  std::chrono::milliseconds last_word{2000};
  /// Send and fetch meshes compressed if that makes them smaller. This pays on networks slower than about 100 MB/s.
  bool compress = false;
  /// Called with false when a server that was there stops answering, and with true when it answers again.
  std::function<void(bool answers)> on_contact;
  /// Called once if nothing has answered for a second at the first contact, which may take as long as `connect`.
  std::function<void()> on_slow_contact;
  Credentials credentials;
  /// For a server in the same process: meshes pass by the calls (client/library/input_file.h). Null: they do not.
  std::shared_ptr<MeshExchange> exchange;

  bool wants_to_stop() const { return interrupted && interrupted(); }
};

/// The final state and the history of a job that has a result.
struct JobResult {
  v1::Job job;
  std::vector<v1::Iteration> history;
};

/// A connection to a server. While the server is unavailable every call is repeated for up to Settings::retry; this is
/// safe because every call of the contract may be repeated. All methods may be called from any thread.
class Client {
 public:
  /// `bulk` carries the meshes, so that they do not delay the other calls. It may be the same channel as `control`.
  Client(const std::shared_ptr<grpc::Channel>& control, const std::shared_ptr<grpc::Channel>& bulk,
         Settings settings = {});
  /// Connects to HOST:PORT or unix:PATH. A unix socket is not encrypted. Fails if nothing answers within
  /// `settings.connect`, or if the credentials cannot be read.
  static Outcome<Client> connect(const std::string& address, Settings settings = {});

  /// Uploads a file unless the server has it already. An upload that was cut goes on where it stopped. A pipe or a
  /// device is first read to its end.
  Outcome<v1::StoredMesh> upload_file(const std::string& path);
  Outcome<v1::StoredMesh> upload(const InputFile& file);
  /// Uploads a CAD file in the same way. It passes through the calls even with Settings::exchange, because a process of
  /// its own reads it from the server's store.
  Outcome<v1::StoredMesh> upload_model(const std::string& path);
  /// Submits a job. A submission that is repeated with the same request id joins the job that exists; an empty id
  /// stands for a random one.
  Outcome<v1::Job> submit(const v1::JobSpec& spec, std::string request_id = {}, bool validate_only = false);
  Outcome<v1::Job> get(const std::string& name);
  Outcome<v1::Job> cancel(const std::string& name);
  Outcome<void> remove(const std::string& name);
  /// Returns all jobs that match, newest first.
  Outcome<std::vector<v1::Job>> list(const v1::ListJobsRequest& filter);
  Outcome<v1::GetServerInfoResponse> info();

  /// Delivers the events after `after_sequence` until the job ends, and returns the job as it ended. A stream that
  /// breaks is resumed. `on_event` returns false to stop watching. Between events `on_wait` is called several times per
  /// second; it may call other methods (for example cancel()), and returns false to stop at once, with Interrupted.
  /// Refused with BAD_OPTION if the job has no event number `after_sequence` yet.
  using OnEvent = std::function<bool(const v1::JobEvent&)>;
  Outcome<v1::Job> watch(const std::string& name, std::int64_t after_sequence, const OnEvent& on_event,
                         const std::function<bool()>& on_wait = {});

  Outcome<JobResult> result(const std::string& name);
  /// Writes the mesh to a temporary file beside `path`, compares its digest, and renames it (OutputFile).
  Outcome<void> download(const v1::StoredMesh& mesh, const std::string& path);

 private:
  /// upload() through the calls.
  Outcome<v1::StoredMesh> send(const InputFile& file);
  template <class Request, class Response>
  Outcome<Response> call(grpc::Status (v1::JobService::Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                         const Request& request);
  /// One attempt of an upload. `committed` is the number of bytes that the server has stored, in and out. Returns
  /// nothing if the call ended with `status` and may be repeated.
  Outcome<std::optional<v1::StoredMesh>> try_upload(const InputFile& file, const v1::UploadHeader& header,
                                                    std::int64_t* committed, RetryPolicy* retries,
                                                    grpc::Status* status);

  std::shared_ptr<v1::JobService::Stub> jobs_;
  std::shared_ptr<v1::MeshService::Stub> meshes_;
  Settings settings_;
  std::shared_ptr<Interrupter> interrupter_;  ///< Null if Settings::interrupted is not set.
};

}  // namespace varimesh::client
