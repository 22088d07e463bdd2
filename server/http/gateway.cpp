// Turns requests into calls.
#include "server/http/gateway.h"

#include <civetweb.h>

#include <algorithm>
#include <charconv>

#include "server/api/requests.h"
#include "server/http/events.h"
#include "server/http/openapi.h"
#include "server/http/page.h"
#include "server/http/transfers.h"
#include "server/streams/status.h"

namespace varimesh::server {
namespace {

/// How many of the threads may be busy with the bytes of meshes, of all callers and of one. The others stay for calls
/// that are short.
constexpr int kMostTransfers = 32, kMostTransfersOfPeer = 8;

/// The same of submissions, whose bodies may come slowly, and take ten times their size as messages.
constexpr int kMostSubmissions = 8, kMostSubmissionsOfPeer = 4;

/// How many may watch jobs. Each has a thread of its own beside the others.
constexpr int kMostWatches = 256, kMostWatchesOfPeer = 128;

/// How many files of the page may be on their way, for which nobody has to say who they are. Each has a thread of its
/// own beside the others.
constexpr int kMostPageFiles = 32;

/// Whether a page of another site may have sent the request: any of its headers says so, however many there are.
bool is_from_elsewhere(const HttpExchange& exchange) {
  const std::string own = (exchange.is_encrypted() ? "https://" : "http://") + exchange.header("Host");
  return !std::ranges::all_of(exchange.headers("Origin"), [&](auto origin) { return origin == own; }) ||
         !std::ranges::all_of(exchange.headers("Sec-Fetch-Site"),
                              [](auto site) { return site == "same-origin" || site == "none"; });
}

Answer<bool> flag_of(const std::string& name, const std::string& value) {
  if (value == "true" || value == "false") return value == "true";
  return bad_request("The field " + name + " must be true or false.");
}

}  // namespace

Gateway::Gateway(const std::shared_ptr<grpc::Channel>& channel, Admit admit)
    : jobs_(v1::JobService::NewStub(channel)),
      meshes_(v1::MeshService::NewStub(channel)),
      optimise_(v1::OptimiseService::NewStub(channel)),
      admit_(std::move(admit)),
      transfers_{PeerCounts(kMostTransfers), PeerCounts(kMostTransfersOfPeer), "uploads and downloads over HTTP"},
      submissions_{PeerCounts(kMostSubmissions), PeerCounts(kMostSubmissionsOfPeer), "submissions over HTTP"},
      watches_{PeerCounts(kMostWatches), PeerCounts(kMostWatchesOfPeer), "watches over HTTP"},
      page_files_{PeerCounts(kMostPageFiles), PeerCounts(0), "files of the page"} {}

Expected<std::unique_ptr<Gateway>> Gateway::start(const HttpPorts& ports, std::shared_ptr<grpc::Channel> channel,
                                                  Admit admit) {
  const auto not_loopback = bad_option("Only this machine may use the port of --http, but '" + ports.plain +
                                       "' is not a loopback address with a port; write --http 127.0.0.1:8080, and "
                                       "--https HOST:PORT for others. If you trust the network and everybody in it, "
                                       "add --insecure.");
  if (!ports.plain.empty() && !is_own_host(ports.plain.c_str()) && !ports.insecure) return not_loopback;
  std::unique_ptr<Gateway> gateway(new Gateway(channel, std::move(admit)));
  const auto behind = ports.encrypted.empty() ? Behind::Nothing : Behind::Tls;
  const auto listening = gateway->http_.listen(ports.plain, "--http", handle, gateway.get(),
                                               kHttpThreads + kMostWatches + kMostPageFiles, behind);
  if (!listening)
    return listening.error().kind == Error::Kind::BadOption ? not_loopback : tl::unexpected(listening.error());
  if (!ports.encrypted.empty()) {
    auto front = TlsFront::start(ports.encrypted, ports.tls, gateway->http_.port_behind());
    if (!front) return tl::unexpected(front.error());
    gateway->front_ = std::move(*front);
  }
  gateway->is_open_ = true;
  return gateway;
}

Gateway::~Gateway() {
  if (front_ != nullptr) front_->stop();
}

std::optional<HttpCaller> Gateway::caller_of(const mg_request_info& request) const {
  if (request.server_port != http_.port_behind()) return HttpCaller{request.remote_addr, "", false};
  const auto caller = front_ == nullptr ? std::nullopt : front_->caller(request.remote_addr, request.remote_port);
  return caller ? std::optional(HttpCaller{caller->address, caller->certificate, true}) : std::nullopt;
}

bool Gateway::is_own_name(const HttpExchange& exchange) const {
  if (exchange.headers("Host").size() != 1) return false;
  const std::string host = exchange.header("Host");
  return is_own_host(host.c_str()) || (exchange.is_encrypted() && front_->is_named(host));
}

int Gateway::handle(mg_connection* connection) {
  const mg_request_info& request = *mg_get_request_info(connection);
  const auto* const gateway = static_cast<const Gateway*>(request.user_data);
  const auto caller = gateway->is_open_ ? gateway->caller_of(request) : std::nullopt;
  HttpExchange exchange(connection, caller.value_or(HttpCaller()), gateway->large_texts_);
  try {
    if (!caller) {
      exchange.refuse(
          {grpc::StatusCode::UNAVAILABLE, "Only the server itself uses this port, or it is still starting."});
      return 1;
    }
    gateway->answer(exchange);
  } catch (const std::exception&) {  // out of memory, if anything
    exchange.refuse(
        {grpc::StatusCode::UNAVAILABLE, "The server has too little memory to answer now; try again later."});
  }
  return 1;  // every request has been answered
}

void Gateway::answer(HttpExchange& exchange) const {
  if (!is_own_name(exchange))
    return exchange.refuse(
        status(bad_request(exchange.is_encrypted()
                               ? "This host is not in the server's certificate; use a name or an address that is."
                               : "Only this machine may use this port; use the address 127.0.0.1.")),
        421);
  // Other pages may link to the page, which says nothing of jobs, and which they can neither read nor frame.
  if (exchange.method() == "GET" || exchange.method() == "HEAD")
    if (const PageFile* file = find_page_file(page_files(), exchange.path()))
      return in_place(exchange, exchange.caller().address, page_files_, [&] { exchange.answer_page_file(*file); });
  if (is_from_elsewhere(exchange))
    return exchange.refuse({grpc::StatusCode::PERMISSION_DENIED, "Pages of other sites may not use this port."});
  const Routed routed = route(exchange.method(), exchange.path());
  if (routed.route != nullptr) return answer(exchange, *routed.route, routed.id);
  if (!routed.methods.empty())
    return exchange.refuse(status(bad_request("This address takes " + routed.methods + " only.")), 405,
                           "Allow: " + routed.methods + "\r\n");
  exchange.refuse({grpc::StatusCode::NOT_FOUND, "There is nothing at this address; docs/http.md lists all."});
}

void Gateway::answer(HttpExchange& exchange, const Route& route, const std::string& id) const {
  using Jobs = v1::JobService::Stub;
  const auto peer = admit_(route.call, exchange.header("Authorization"), exchange.caller());
  if (!peer) return exchange.refuse(status(peer.error()));
  exchange.set_peer(*peer);
  const std::string job = "jobs/" + id;
  const auto named = [&](auto request) {
    request.set_name(job);
    return request;
  };
  switch (route.to) {
    case Route::To::Info:
      return exchange.call(*jobs_, &Jobs::GetServerInfo, v1::GetServerInfoRequest());
    case Route::To::Document:
      return exchange.answer_json(openapi_document());
    case Route::To::Submit:
      return submit(exchange);
    case Route::To::List:
      return list(exchange);
    case Route::To::Get:
      return exchange.call(*jobs_, &Jobs::GetJob, named(v1::GetJobRequest()));
    case Route::To::Delete:
      return exchange.call(*jobs_, &Jobs::DeleteJob, named(v1::DeleteJobRequest()));
    case Route::To::Cancel:
      return exchange.call(*jobs_, &Jobs::CancelJob, named(v1::CancelJobRequest()));
    case Route::To::Events:
      return work_long(exchange, route.call, watches_, [&] { send_events(exchange, *jobs_, job); });
    case Route::To::Result:
      return work_long(exchange, route.call, transfers_, [&] { send_result(exchange, *jobs_, *meshes_, job); });
    case Route::To::Mesh:
      return work_long(exchange, route.call, transfers_, [&] { send_mesh_of(exchange, *meshes_, job); });
    case Route::To::SendMesh:
      return work_long(exchange, route.call, transfers_, [&] { receive_mesh(exchange, *meshes_); });
    case Route::To::QueryUpload:
      return tell_upload(exchange, *meshes_, id);
  }
}

void Gateway::work_long(HttpExchange& exchange, Method method, Places& places,
                        const std::function<void()>& work) const {
  const auto peer = admit_(method, exchange.header("Authorization"), exchange.caller());
  if (!peer) return exchange.refuse(status(peer.error()));
  in_place(exchange, *peer, places, work);
}

void Gateway::in_place(HttpExchange& exchange, const std::string& peer, Places& places,
                       const std::function<void()>& work) const {
  const auto own = places.of_peer.take(peer), place = places.all.take("");
  if (own == nullptr) return exchange.refuse(status(peer_limit(peer, places.of_peer.most(), places.what)));
  if (place == nullptr) return exchange.refuse(status(peer_limit("all callers", places.all.most(), places.what)));
  const auto open = open_.add(exchange.socket());
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
    return exchange.refuse(status(bad_request("validateOnly does not go with a form; send the spec alone as JSON.")));
  if (has_mesh)
    return work_long(exchange, Method::Optimise, transfers_,
                     [&] { receive_job(exchange, *optimise_, request.request_id()); });
  work_long(exchange, Method::SubmitJob, submissions_, [&] {
    if (const auto read = exchange.read(request.mutable_spec(), kMostSpecBytes); !read)
      return exchange.refuse(status(read.error()));
    exchange.call(*jobs_, &v1::JobService::Stub::SubmitJob, request);
  });
}

}  // namespace varimesh::server
