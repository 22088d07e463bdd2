// Connecting, and the calls about jobs that have a single answer.
#include "client/client.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <optional>

#include "client/library/authorisation.h"
#include "client/library/failures.h"
#include "client/library/interrupter.h"
#include "client/library/random_id.h"
#include "client/library/retry_policy.h"
#include "client/library/spoken.h"

namespace varimesh::client {
namespace {

constexpr char kInterruptedCall[] = "Interrupted before the server answered.";

}  // namespace

Client::Client(const std::shared_ptr<grpc::Channel>& control, const std::shared_ptr<grpc::Channel>& bulk,
               Settings settings)
    : jobs_(v1::JobService::NewStub(control)),
      meshes_(v1::MeshService::NewStub(bulk)),
      settings_(std::move(settings)),
      interrupter_(settings_.interrupted ? std::make_shared<Interrupter>(settings_.interrupted) : nullptr) {}

namespace {

/// Removes "http://" or "https://" and a slash at the end, which people copy from a browser. Returns whether the
/// address asks for TLS.
bool make_plain(std::string* address) {
  if (address->starts_with("unix:")) return false;
  const bool encrypted = address->starts_with("https://");
  if (encrypted) address->erase(0, sizeof "https://" - 1);
  if (address->starts_with("http://")) address->erase(0, sizeof "http://" - 1);
  while (address->ends_with('/')) address->pop_back();
  return encrypted;
}

/// Says why a connection does not come about.
std::string reason_of(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(1));
  v1::GetServerInfoResponse response;
  return v1::JobService::NewStub(channel)->GetServerInfo(&context, {}, &response).error_message();
}

/// Why a server that speaks TLS and the client do not come together. Nothing if that cannot be said yet.
std::optional<tl::unexpected<Failure>> not_let_in(const std::shared_ptr<grpc::Channel>& channel,
                                                  const std::string& address) {
  const std::string reason = reason_of(channel);
  const auto says = [&](const char* words) { return reason.find(words) != std::string::npos; };
  // A server of gRPC closes the connection without a word if it does not accept the client's certificate.
  if (says("Socket closed") || says("Connection reset"))
    return transport_failure("The server at " + address +
                             " asks for a client's certificate that has not expired, from an authority that the server "
                             "knows; name the certificate with --tls-certificate and --tls-key.");
  if (says("handshake failed") || says("peer certificate"))
    return transport_failure("The certificate of the server at " + address +
                             " is not for this address, has expired, or does not come from the authority of "
                             "--tls-authority (" +
                             reason + "); check the address and the authority.");
  return std::nullopt;
}

/// Why no connection to a server at this address comes about, and what to do.
tl::unexpected<Failure> no_server(const std::shared_ptr<grpc::Channel>& channel, const std::string& address,
                                  bool encrypted) {
  if (encrypted)
    return transport_failure("There is no server at " + address + " that answers with TLS (" + reason_of(channel) +
                             "); check the address, and that the server's certificate is for this address and comes "
                             "from the authority (--tls-authority).");
  return transport_failure("There is no server at " + address + "; start varimeshd there, or name another server.");
}

/// Waits for the first contact.
Outcome<void> meet(const std::shared_ptr<grpc::Channel>& channel, const std::string& address, bool encrypted,
                   const Settings& settings) {
  constexpr auto kLook = std::chrono::milliseconds(50), kBeforeListening = std::chrono::milliseconds(400),
                 kSure = std::chrono::milliseconds(700),  // a server that is being started may need so long
      kSlow = std::chrono::milliseconds(1000);
  const auto begin = std::chrono::steady_clock::now();
  bool has_listened = false, is_refused = false, speaks_tls = false, is_slow = false;
  while (!channel->WaitForConnected(std::chrono::system_clock::now() + kLook)) {
    if (settings.wants_to_stop()) return interruption(kInterruptedCall);
    const auto passed = std::chrono::steady_clock::now() - begin;
    if (!has_listened && passed > std::min<std::chrono::nanoseconds>(kBeforeListening, settings.connect)) {
      has_listened = true;
      const Spoken heard = heard_from(address, std::chrono::seconds(1), [&] { return settings.wants_to_stop(); });
      is_refused = heard == Spoken::Refused;
      speaks_tls = heard == Spoken::Tls;
      if (heard == Spoken::Tls && !encrypted)
        return transport_failure("The server at " + address +
                                 " wants TLS; name the authority of its certificate with --tls-authority, or begin "
                                 "the address with https:// if this machine knows the authority.");
      if (heard == Spoken::Plain && encrypted)
        return transport_failure("The server at " + address +
                                 " speaks no TLS; leave out https:// and the certificates, or start it with "
                                 "--tls-certificate.");
    }
    if (!is_slow && passed > kSlow) {
      is_slow = true;
      if (settings.on_slow_contact) settings.on_slow_contact();
    }
    if (is_refused && passed > kSure) {
      if (heard_from(address, std::chrono::milliseconds(100), [&] { return settings.wants_to_stop(); }) ==
          Spoken::Refused)
        return no_server(channel, address, false);
      is_refused = false;
    }
    if (speaks_tls && passed > kSure) {
      if (const auto why = not_let_in(channel, address)) return *why;
      speaks_tls = false;
    }
    if (passed > settings.connect) return no_server(channel, address, encrypted);
  }
  return {};
}

}  // namespace

Outcome<Client> Client::connect(const std::string& given, Settings settings) {
  std::string address = given;
  bool encrypted = make_plain(&address);
  if (address.find(':') == std::string::npos)
    return refusal("BAD_OPTION", "The address '" + address + "' has no port; write HOST:PORT or unix:PATH.");
  auto token = token_of(settings.credentials);
  if (!token) return tl::unexpected(token.error());
  settings.credentials.token = std::move(*token);
  const Credentials files = address.starts_with("unix:") ? Credentials{} : settings.credentials;
  encrypted = encrypted || !(files.authority + files.certificate + files.key).empty();
  const auto credentials = channel_credentials(files, encrypted);
  if (!credentials) return tl::unexpected(credentials.error());
  const auto channel = [&](int number) {
    grpc::ChannelArguments arguments;
    // Two channels with equal arguments would share one connection.
    arguments.SetInt("varimesh.channel", number);
    arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
    // A server that hangs, or that the network has lost, is noticed within 20 s. The server allows a ping every 10 s.
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 15'000);
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5'000);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2'000);
    return grpc::CreateCustomChannel(address, *credentials, arguments);
  };
  const auto control = channel(1);
  if (auto met = meet(control, address, encrypted, settings); !met) return tl::unexpected(met.error());
  return Client(control, channel(2), std::move(settings));
}

template <class Request, class Response>
Outcome<Response> Client::call(grpc::Status (v1::JobService::Stub::*method)(grpc::ClientContext*, const Request&,
                                                                            Response*),
                               const Request& request) {
  RetryPolicy retries(settings_);
  const bool last = settings_.wants_to_stop();  // see Settings::last_word
  while (true) {
    grpc::ClientContext context;
    authorise(settings_, &context);
    context.set_deadline(std::chrono::system_clock::now() + (last ? settings_.last_word : std::chrono::seconds(30)));
    const Interrupter::Registration registration(last ? nullptr : interrupter_.get(), &context);
    Response response;
    const grpc::Status status = ((*jobs_).*method)(&context, request, &response);
    if (status.ok()) {
      retries.server_answered();
      return response;
    }
    if (retries.wait_to_retry(status)) continue;
    if (!last && settings_.wants_to_stop()) return interruption(kInterruptedCall);
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
  RetryPolicy retries(settings_);
  while (true) {
    grpc::ClientContext context;
    authorise(settings_, &context);
    const Interrupter::Registration registration(interrupter_.get(), &context);
    const auto reader = jobs_->GetResult(&context, request);
    JobResult result;
    v1::GetResultResponse response;
    while (reader->Read(&response)) {
      if (response.has_job()) result.job = response.job();
      for (const v1::Iteration& iteration : response.history().iterations()) result.history.push_back(iteration);
    }
    const grpc::Status status = reader->Finish();
    if (status.ok()) {
      retries.server_answered();
      return result;
    }
    if (retries.wait_to_retry(status)) continue;
    if (settings_.wants_to_stop()) return interruption("Interrupted while the history was being fetched.");
    return tl::unexpected(failure_of(status));
  }
}

}  // namespace varimesh::client
