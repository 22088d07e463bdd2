// Turns requests into calls.
#include "server/http/gateway.h"

#include <civetweb.h>

#include <charconv>
#include <chrono>

#include "server/api/context.h"

namespace varimesh::server {
namespace {

constexpr std::string_view kJobs = "/v1/jobs";

/// How long a call may take.
constexpr std::chrono::seconds kPatience{60};

/// Calls a method of this server for the caller of the request, and answers with what it says.
template <class Stub, class Request, class Response>
void call(HttpExchange& exchange, Stub& stub,
          grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*), const Request& request) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kPatience);
  for (const char* name : {"authorization", "traceparent"})
    if (const std::string value = exchange.header(name); !value.empty()) context.AddMetadata(name, value);
  context.AddMetadata(key_of_address(), exchange.address());
  Response response;
  const grpc::Status status = (stub.*method)(&context, request, &response);
  if (status.ok())
    exchange.answer(response);
  else
    exchange.refuse(status);
}

/// Whether the request may come from a browser at all: no page, or one of this very port.
bool is_from_elsewhere(const HttpExchange& exchange) {
  const std::string origin = exchange.header("Origin"), site = exchange.header("Sec-Fetch-Site");
  return (!origin.empty() && origin != "http://" + exchange.header("Host")) ||
         (!site.empty() && site != "same-origin" && site != "none");
}

grpc::Status unknown_field(const std::string& name, const char* known) {
  return status(bad_request("There is no field '" + name + "' in this address; there are " + known + "."));
}

Answer<bool> flag_of(const std::string& name, const std::string& value) {
  if (value == "true" || value == "false") return value == "true";
  return bad_request("The field " + name + " must be true or false.");
}

void refuse_method(HttpExchange& exchange, const std::string& allowed) {
  exchange.refuse(status(bad_request("This address takes " + allowed + " only.")), 405, "Allow: " + allowed + "\r\n");
}

void refuse_address(HttpExchange& exchange) {
  exchange.refuse({grpc::StatusCode::NOT_FOUND, "There is nothing at this address; docs/http.md lists all."});
}

}  // namespace

Expected<std::unique_ptr<Gateway>> Gateway::start(const std::string& address, std::shared_ptr<grpc::Channel> channel,
                                                  Admit admit) {
  const auto not_loopback = bad_option("Only this machine may use the port of --http, but '" + address +
                                       "' is not a loopback address with a port; write --http 127.0.0.1:8080, and let "
                                       "a proxy encrypt for others.");
  if (!is_own_host(address.c_str())) return not_loopback;
  std::unique_ptr<Gateway> gateway(new Gateway(channel, std::move(admit)));
  const auto listening = gateway->http_.listen(address, "--http", handle, gateway.get());
  if (!listening)
    return listening.error().kind == Error::Kind::BadOption ? not_loopback : tl::unexpected(listening.error());
  return gateway;
}

int Gateway::handle(mg_connection* connection) {
  HttpExchange exchange(connection);
  try {
    static_cast<const Gateway*>(mg_get_request_info(connection)->user_data)->answer(exchange);
  } catch (const std::exception&) {  // out of memory, if anything
    exchange.refuse(
        {grpc::StatusCode::UNAVAILABLE, "The server has too little memory to answer now; try again later."});
  }
  return 1;  // every request has been answered
}

void Gateway::answer(HttpExchange& exchange) const {
  if (!is_own_host(exchange.header("Host").c_str()))
    return exchange.refuse(status(bad_request("Only this machine may use this port; use the address 127.0.0.1.")), 421);
  if (is_from_elsewhere(exchange))
    return exchange.refuse({grpc::StatusCode::PERMISSION_DENIED, "Pages of other sites may not use this port."});
  if (exchange.path() == "/v1/info") {
    if (exchange.method() != "GET") return refuse_method(exchange, "GET");
    return call(exchange, *jobs_, &v1::JobService::Stub::GetServerInfo, v1::GetServerInfoRequest());
  }
  if (exchange.path().starts_with(kJobs)) return answer_about_jobs(exchange);
  refuse_address(exchange);
}

void Gateway::answer_about_jobs(HttpExchange& exchange) const {
  std::string_view rest = exchange.path().substr(kJobs.size());
  if (rest.empty()) {
    if (exchange.method() == "GET") return list(exchange);
    if (exchange.method() == "POST") return submit(exchange);
    return refuse_method(exchange, "GET, POST");
  }
  if (!rest.starts_with('/')) return refuse_address(exchange);
  rest.remove_prefix(1);
  const auto end = std::min(rest.find('/'), rest.size());
  answer_about(exchange, "jobs/" + std::string(rest.substr(0, end)), rest.substr(end));
}

void Gateway::answer_about(HttpExchange& exchange, const std::string& job, std::string_view action) const {
  const auto named = [&](auto request) {
    request.set_name(job);
    return request;
  };
  if (action == "/cancel") {
    if (exchange.method() != "POST") return refuse_method(exchange, "POST");
    return call(exchange, *jobs_, &v1::JobService::Stub::CancelJob, named(v1::CancelJobRequest()));
  }
  if (!action.empty()) return refuse_address(exchange);
  if (exchange.method() == "GET")
    return call(exchange, *jobs_, &v1::JobService::Stub::GetJob, named(v1::GetJobRequest()));
  if (exchange.method() == "DELETE")
    return call(exchange, *jobs_, &v1::JobService::Stub::DeleteJob, named(v1::DeleteJobRequest()));
  refuse_method(exchange, "GET, DELETE");
}

void Gateway::list(HttpExchange& exchange) const {
  const auto fields = exchange.query();
  if (!fields) return exchange.refuse(status(fields.error()));
  v1::ListJobsRequest request;
  constexpr std::string_view kLabels = "labels.";
  for (const auto& [name, value] : *fields) {
    if (name == "pageToken") {
      request.set_page_token(value);
    } else if (name == "pageSize") {
      std::int32_t size = 0;
      const auto read = std::from_chars(value.data(), value.data() + value.size(), size);
      if (read.ec != std::errc() || read.ptr != value.data() + value.size())
        return exchange.refuse(status(bad_request("The field pageSize must be a number.")));
      request.set_page_size(size);
    } else if (name == "states") {
      v1::JobState state{};
      if (!v1::JobState_Parse(value, &state))
        return exchange.refuse(status(bad_request("There is no state '" + value + "'; write JOB_STATE_RUNNING.")));
      request.add_states(state);
    } else if (name.starts_with(kLabels)) {
      (*request.mutable_labels())[name.substr(kLabels.size())] = value;
    } else {
      return exchange.refuse(unknown_field(name, "states, labels.KEY, pageSize and pageToken"));
    }
  }
  call(exchange, *jobs_, &v1::JobService::Stub::ListJobs, request);
}

void Gateway::submit(HttpExchange& exchange) const {
  const auto admitted = admit_(Method::SubmitJob, exchange.header("Authorization"), exchange.address());
  if (!admitted) return exchange.refuse(status(admitted.error()));
  const auto fields = exchange.query();
  if (!fields) return exchange.refuse(status(fields.error()));
  v1::SubmitJobRequest request;
  for (const auto& [name, value] : *fields) {
    if (name == "requestId") {
      request.set_request_id(value);
    } else if (name == "validateOnly") {
      const auto flag = flag_of(name, value);
      if (!flag) return exchange.refuse(status(flag.error()));
      request.set_validate_only(*flag);
    } else {
      return exchange.refuse(unknown_field(name, "requestId and validateOnly"));
    }
  }
  constexpr std::size_t kMostBytes = std::size_t{4} << 20;  // as much as the call may have
  if (const auto read = exchange.read(request.mutable_spec(), kMostBytes); !read)
    return exchange.refuse(status(read.error()));
  call(exchange, *jobs_, &v1::JobService::Stub::SubmitJob, request);
}

}  // namespace varimesh::server
