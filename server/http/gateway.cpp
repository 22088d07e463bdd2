// Turns requests into calls.
#include "server/http/gateway.h"

#include <civetweb.h>

#include <algorithm>
#include <charconv>

#include "server/http/events.h"
#include "server/http/transfers.h"
#include "server/streams/status.h"

namespace varimesh::server {
namespace {

constexpr std::string_view kJobs = "/v1/jobs", kUploads = "/v1/uploads/";

/// How many of the threads may be busy with the bytes of meshes, of all callers and of one. The others stay for calls
/// that are short.
constexpr int kMostTransfers = 32, kMostTransfersOfPeer = 8;
/// How many may watch jobs. Each has a thread of its own beside the others.
constexpr int kMostWatches = 256, kMostWatchesOfPeer = 128;

/// Whether a page of another site may have sent the request: any of its headers says so, however many there are.
bool is_from_elsewhere(const HttpExchange& exchange) {
  const std::string own = "http://" + exchange.header("Host");
  return !std::ranges::all_of(exchange.headers("Origin"), [&](auto origin) { return origin == own; }) ||
         !std::ranges::all_of(exchange.headers("Sec-Fetch-Site"),
                              [](auto site) { return site == "same-origin" || site == "none"; });
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

Gateway::Gateway(const std::shared_ptr<grpc::Channel>& channel, Admit admit)
    : jobs_(v1::JobService::NewStub(channel)),
      meshes_(v1::MeshService::NewStub(channel)),
      optimise_(v1::OptimiseService::NewStub(channel)),
      admit_(std::move(admit)),
      transfers_{PeerCounts(kMostTransfers), PeerCounts(kMostTransfersOfPeer), "uploads and downloads over HTTP"},
      watches_{PeerCounts(kMostWatches), PeerCounts(kMostWatchesOfPeer), "watches over HTTP"} {}

Expected<std::unique_ptr<Gateway>> Gateway::start(const std::string& address, std::shared_ptr<grpc::Channel> channel,
                                                  Admit admit) {
  const auto not_loopback = bad_option("Only this machine may use the port of --http, but '" + address +
                                       "' is not a loopback address with a port; write --http 127.0.0.1:8080, and let "
                                       "a proxy encrypt for others.");
  if (!is_own_host(address.c_str())) return not_loopback;
  std::unique_ptr<Gateway> gateway(new Gateway(channel, std::move(admit)));
  const auto listening = gateway->http_.listen(address, "--http", handle, gateway.get(), kHttpThreads + kMostWatches);
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
  if (exchange.headers("Host").size() != 1 || !is_own_host(exchange.header("Host").c_str()))
    return exchange.refuse(status(bad_request("Only this machine may use this port; use the address 127.0.0.1.")), 421);
  if (is_from_elsewhere(exchange))
    return exchange.refuse({grpc::StatusCode::PERMISSION_DENIED, "Pages of other sites may not use this port."});
  if (exchange.path() == "/v1/info") {
    if (exchange.method() != "GET") return refuse_method(exchange, "GET");
    return exchange.call(*jobs_, &v1::JobService::Stub::GetServerInfo, v1::GetServerInfoRequest());
  }
  if (exchange.path() == "/v1/meshes") {
    if (exchange.method() != "POST" && exchange.method() != "PUT") return refuse_method(exchange, "POST, PUT");
    return work_long(exchange, Method::SendMesh, transfers_, [&] { receive_mesh(exchange, *meshes_); });
  }
  if (exchange.path().starts_with(kUploads)) {
    if (exchange.method() != "GET") return refuse_method(exchange, "GET");
    return tell_upload(exchange, *meshes_, std::string(exchange.path().substr(kUploads.size())));
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
    return exchange.call(*jobs_, &v1::JobService::Stub::CancelJob, named(v1::CancelJobRequest()));
  }
  if (action == "/result") {
    if (exchange.method() != "GET") return refuse_method(exchange, "GET");
    return work_long(exchange, Method::DownloadMesh, transfers_, [&] { send_result(exchange, *jobs_, *meshes_, job); });
  }
  if (action == "/events") {
    if (exchange.method() != "GET") return refuse_method(exchange, "GET");
    return work_long(exchange, Method::WatchJob, watches_, [&] { send_events(exchange, *jobs_, job); });
  }
  if (!action.empty()) return refuse_address(exchange);
  if (exchange.method() == "GET")
    return exchange.call(*jobs_, &v1::JobService::Stub::GetJob, named(v1::GetJobRequest()));
  if (exchange.method() == "DELETE")
    return exchange.call(*jobs_, &v1::JobService::Stub::DeleteJob, named(v1::DeleteJobRequest()));
  refuse_method(exchange, "GET, DELETE");
}

void Gateway::work_long(HttpExchange& exchange, Method method, Places& places,
                        const std::function<void()>& work) const {
  const auto peer = admit_(method, exchange.header("Authorization"), exchange.address());
  if (!peer) return exchange.refuse(status(peer.error()));
  const auto own = places.of_peer.take(*peer), place = places.all.take("");
  if (own == nullptr) return exchange.refuse(status(peer_limit(*peer, places.of_peer.most(), places.what)));
  if (place == nullptr) return exchange.refuse(status(peer_limit("all callers", places.all.most(), places.what)));
  work();
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
      return exchange.refuse(status(unknown_field(name, "states, labels.KEY, pageSize and pageToken")));
    }
  }
  exchange.call(*jobs_, &v1::JobService::Stub::ListJobs, request);
}

void Gateway::submit(HttpExchange& exchange) const {
  const bool has_mesh = exchange.has_type(kFormType);
  const auto admitted =
      admit_(has_mesh ? Method::Optimise : Method::SubmitJob, exchange.header("Authorization"), exchange.address());
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
      return exchange.refuse(status(unknown_field(name, "requestId and validateOnly")));
    }
  }
  if (has_mesh && request.validate_only())
    return exchange.refuse(status(bad_request("A form cannot be checked only; send the spec alone as JSON.")));
  if (has_mesh)
    return work_long(exchange, Method::Optimise, transfers_,
                     [&] { receive_job(exchange, *optimise_, request.request_id()); });
  constexpr std::size_t kMostBytes = std::size_t{4} << 20;  // as much as the call may have
  if (const auto read = exchange.read(request.mutable_spec(), kMostBytes); !read)
    return exchange.refuse(status(read.error()));
  exchange.call(*jobs_, &v1::JobService::Stub::SubmitJob, request);
}

}  // namespace varimesh::server
