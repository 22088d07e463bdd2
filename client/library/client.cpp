// Connecting, and the calls about jobs that have a single answer.
#include "client/client.h"

#include <grpcpp/grpcpp.h>

#include "client/library/failures.h"
#include "client/library/interrupter.h"
#include "client/library/random_id.h"
#include "client/library/retry_policy.h"

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

/// The address without "http://" and a slash at the end, which people copy from a browser. Errors: an address with
/// "https://", because this client does not encrypt.
Outcome<std::string> plain_address(std::string address) {
  if (address.starts_with("https://"))
    return refusal("BAD_OPTION", "The address " + address +
                                     " asks for TLS, which this client does not speak; give HOST:PORT of a server "
                                     "without TLS, for example through an SSH tunnel.");
  if (address.starts_with("http://")) address.erase(0, sizeof "http://" - 1);
  if (!address.starts_with("unix:"))
    while (address.ends_with('/')) address.pop_back();
  return address;
}

}  // namespace

Outcome<Client> Client::connect(const std::string& given, Settings settings) {
  const auto plain = plain_address(given);
  if (!plain) return tl::unexpected(plain.error());
  const std::string& address = *plain;
  const auto channel = [&](int number) {
    grpc::ChannelArguments arguments;
    // Two channels with equal arguments would share one connection.
    arguments.SetInt("varimesh.channel", number);
    arguments.SetInt(GRPC_ARG_ENABLE_RETRIES, 0);
    // A server that hangs, or that the network has lost, is noticed within 20 s. The server allows a ping every 10 s.
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIME_MS, 15'000);
    arguments.SetInt(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 5'000);
    arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 2'000);
    return grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
  };
  const auto control = channel(1);
  const auto deadline = std::chrono::steady_clock::now() + settings.connect;
  while (!control->WaitForConnected(std::chrono::system_clock::now() + std::chrono::milliseconds(100))) {
    if (settings.wants_to_stop()) return interruption(kInterruptedCall);
    if (std::chrono::steady_clock::now() > deadline)
      return transport_failure("There is no server at " + address + "; start varimeshd there, or name another server.");
  }
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
