#include "server/http/exchange.h"

#include <civetweb.h>
#include <google/protobuf/util/json_util.h>
#include <strings.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <future>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/api/context.h"
#include "server/api/requests.h"
#include "server/http/open_sockets.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

using google::protobuf::util::JsonStringToMessage;
using google::protobuf::util::MessageToJsonString;

/// How long a body of JSON, or a piece of a mesh, may take to come.
constexpr std::chrono::seconds kPatience{30};

/// The codes of HTTP, as google/rpc/code.proto maps them.
int http_code(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::OK:
      return 200;
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::FAILED_PRECONDITION:
    case grpc::StatusCode::OUT_OF_RANGE:
      return 400;
    case grpc::StatusCode::UNAUTHENTICATED:
      return 401;
    case grpc::StatusCode::PERMISSION_DENIED:
      return 403;
    case grpc::StatusCode::NOT_FOUND:
      return 404;
    case grpc::StatusCode::ALREADY_EXISTS:
    case grpc::StatusCode::ABORTED:
      return 409;
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return 429;
    case grpc::StatusCode::UNAVAILABLE:
      return 503;
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return 504;
    default:
      return 500;
  }
}

/// The header Retry-After, if the status says when to try again.
std::string retry_header(const google::rpc::Status& status) {
  google::rpc::RetryInfo retry;
  for (const auto& detail : status.details())
    if (detail.UnpackTo(&retry)) return "Retry-After: " + std::to_string(retry.retry_delay().seconds()) + "\r\n";
  return {};
}

}  // namespace

HttpExchange::HttpExchange(mg_connection* connection, HttpCaller caller, Pool& large_texts)
    : connection_(connection),
      request_(*mg_get_request_info(connection)),
      caller_(std::move(caller)),
      large_texts_(large_texts) {}

std::string_view HttpExchange::method() const { return request_.request_method; }

std::string_view HttpExchange::path() const { return request_.local_uri == nullptr ? "" : request_.local_uri; }

std::string HttpExchange::header(const char* name) const {
  const char* const value = mg_get_header(connection_, name);
  const std::string text = value == nullptr ? "" : value;
  // gRPC takes nothing else as metadata.
  return std::ranges::all_of(text, [](char c) { return c >= ' ' && c <= '~'; }) ? text : "";
}

std::vector<std::string_view> HttpExchange::headers(const char* name) const {
  std::vector<std::string_view> found;
  for (int i = 0; i < request_.num_headers; ++i)
    if (::strcasecmp(request_.http_headers[i].name, name) == 0) found.emplace_back(request_.http_headers[i].value);
  return found;
}

Answer<std::vector<std::pair<std::string, std::string>>> HttpExchange::query() const {
  std::vector<std::pair<std::string, std::string>> fields;
  if (request_.query_string == nullptr) return fields;
  std::string text = request_.query_string;
  constexpr std::size_t kMost = 64;
  std::array<mg_header, kMost> found{};
  const int count = mg_split_form_urlencoded(text.data(), found.data(), kMost);
  if (count < 0 || std::ranges::count(std::string_view(request_.query_string), '&') >= static_cast<long>(kMost))
    return bad_request("The address has more than " + std::to_string(kMost) + " fields after its question mark.");
  for (int i = 0; i < count; ++i) {
    const mg_header& one = found[static_cast<std::size_t>(i)];
    fields.emplace_back(one.name, one.value == nullptr ? "" : one.value);
  }
  return fields;
}

bool HttpExchange::has_type(std::string_view type) const {
  const std::string sent = header("Content-Type");
  return std::string_view(sent).substr(0, sent.find(';')) == type;
}

Answer<void> HttpExchange::expect(std::string_view type) const {
  // Pages of other sites cannot send JSON and bytes without asking first.
  if (!has_type(type)) return bad_request("The body must have the header Content-Type: " + std::string(type) + ".");
  if (size() < 0) return bad_request("The request does not say how long its body is; send the header Content-Length.");
  return {};
}

std::int64_t HttpExchange::size() const { return request_.content_length; }

int HttpExchange::socket() {
  if (!socket_) socket_ = socket_of(request_);
  return *socket_;
}

void HttpExchange::in_turn(std::size_t bytes, const std::function<void()>& work) {
  if (bytes <= kMostRequestBytes) return work();
  const auto task = std::make_shared<std::packaged_task<void()>>(work);
  std::future<void> done = task->get_future();
  large_texts_.post([task] { (*task)(); }, peer_);
  done.get();
}

std::size_t HttpExchange::read_some(char* bytes, std::size_t count, Pauses pauses) {
  // civetweb waits for all bytes that it is asked for as long as some of them come, so it is asked for those that are
  // there, or for one. After two seconds without any it says 0, and -1 if the client is gone.
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  std::size_t have = 0;
  while (have < count && std::chrono::steady_clock::now() < deadline) {
    int there = 0;
    if (socket() < 0 || ::ioctl(socket(), FIONREAD, &there) != 0) there = 0;
    const std::size_t wanted = std::min(static_cast<std::size_t>(std::max(there, 1)), count - have);
    const int got = mg_read(connection_, bytes + have, wanted);
    if (got < 0 || (got == 0 && pauses == Pauses::Short)) break;
    have += static_cast<std::size_t>(got);
  }
  return have;
}

Answer<void> HttpExchange::read(google::protobuf::Message* message, std::size_t most) {
  if (const auto expected = expect(kJsonType); !expected) return expected;
  const auto count = static_cast<std::size_t>(size());
  if (count > most)
    return bad_request("The body has " + std::to_string(count) + " bytes, but may have " + std::to_string(most) + ".");
  std::string body(count, '\0');
  if (read_some(body.data(), count, Pauses::Short) < count)
    return bad_request("The body of the request did not come at once.");
  return read_json(body, message);
}

Answer<void> HttpExchange::read_json(const std::string& text, google::protobuf::Message* message) {
  google::protobuf::util::Status parsed;
  in_turn(text.size(), [&] { parsed = JsonStringToMessage(text, message); });
  if (parsed.ok()) return {};
  return bad_request("The body is no JSON of " + message->GetDescriptor()->full_name() + " (" +
                     std::string(parsed.message()) + ").");
}

void HttpExchange::pass_on(grpc::ClientContext& context) const {
  for (const char* name : {"authorization", "traceparent"})
    if (const std::string value = header(name); !value.empty()) context.AddMetadata(name, value);
  context.AddMetadata(key_of_address(), caller_.address);
  if (!caller_.certificate.empty()) context.AddMetadata(key_of_certificate(), caller_.certificate);
}

void HttpExchange::begin_bytes(const ByteRange& range, std::int64_t size, const std::string& digest) {
  const std::string part = "Content-Range: bytes " + std::to_string(range.first) + "-" + std::to_string(range.end - 1) +
                           "/" + std::to_string(size) + "\r\n";
  const std::string tag = digest.empty() ? "" : "Accept-Ranges: bytes\r\nETag: \"" + digest + "\"\r\n";
  mg_printf(connection_,
            "HTTP/1.1 %s\r\nContent-Type: %s\r\nContent-Length: %lld\r\n%s%s"
            "Content-Disposition: attachment\r\nCache-Control: no-store\r\nX-Content-Type-Options: nosniff\r\n"
            "Cross-Origin-Resource-Policy: same-origin\r\nConnection: close\r\n\r\n",
            range.is_part ? "206 Partial Content" : "200 OK", kBytesType.data(),
            static_cast<long long>(range.end - range.first), range.is_part ? part.c_str() : "", tag.c_str());
}

bool HttpExchange::send(std::string_view bytes) {
  // civetweb gives up after two seconds without progress, and says so in the same way as if the client were gone.
  constexpr std::size_t kPiece = std::size_t{64} << 10;
  constexpr std::chrono::milliseconds kStalled{1500};
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (!bytes.empty()) {
    const auto begun = std::chrono::steady_clock::now();
    const int sent = mg_write(connection_, bytes.data(), std::min(kPiece, bytes.size()));
    const auto now = std::chrono::steady_clock::now();
    if ((sent <= 0 && now - begun < kStalled) || now >= deadline) return false;
    bytes.remove_prefix(static_cast<std::size_t>(std::max(sent, 0)));
  }
  return true;
}

void HttpExchange::begin_events() {
  // Otherwise megabytes wait for a client that reads nothing, and its place is kept until all of them are full.
  constexpr int kMostWaiting = 64 << 10;
  ::setsockopt(socket(), SOL_SOCKET, SO_SNDBUF, &kMostWaiting, sizeof kMostWaiting);
  // nginx and others would keep events back until they have many.
  mg_printf(connection_,
            "HTTP/1.1 200 OK\r\nContent-Type: text/event-stream\r\n%sCache-Control: no-store\r\n"
            "X-Accel-Buffering: no\r\nX-Content-Type-Options: nosniff\r\nCross-Origin-Resource-Policy: same-origin\r\n"
            "Connection: close\r\n\r\n",
            has_chunks() ? "Transfer-Encoding: chunked\r\n" : "");
}

bool HttpExchange::has_chunks() const { return std::string_view(request_.http_version) == "1.1"; }

bool HttpExchange::send_chunk(std::string_view text) {
  if (!has_chunks()) return send(text);
  std::array<char, 16> size{};
  const auto end = std::to_chars(size.data(), size.data() + size.size(), text.size(), 16).ptr;
  return send(std::string(size.data(), end) + "\r\n" + std::string(text) + "\r\n");
}

void HttpExchange::answer_nothing() {
  mg_printf(connection_, "HTTP/1.1 204 No Content\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n");
}

void HttpExchange::answer(const google::protobuf::Message& message) {
  std::string text;
  bool is_written = false;
  in_turn(message.ByteSizeLong(), [&] { is_written = MessageToJsonString(message, &text).ok(); });
  if (!is_written)
    return refuse({grpc::StatusCode::INTERNAL, "The answer cannot be written as JSON; please report it."});
  answer_json(text + "\n");
}

void HttpExchange::answer_json(std::string_view text) { send_http(connection_, 200, kJsonType, text); }

void HttpExchange::answer_page_file(const PageFile& file) { send_page_file(connection_, file); }

void HttpExchange::refuse(const grpc::Status& status, int http, const std::string& more) {
  google::rpc::Status full;
  if (!full.ParseFromString(status.error_details()) || full.code() != status.error_code()) {
    full.Clear();
    full.set_code(status.error_code());
    full.set_message(status.error_message());
  }
  std::string text;
  if (!MessageToJsonString(full, &text).ok()) text = "{}";
  const int code = http != 0 ? http : http_code(status.error_code());
  const std::string headers = more + retry_header(full) + (code == 401 ? "WWW-Authenticate: Bearer\r\n" : "");
  send_http(connection_, code, kJsonType, text + "\n", headers.c_str());
}

Refusal unknown_field(const std::string& name, const std::string& known) {
  return bad_request("There is no field '" + name + "' in this address; there are " + known + ".");
}

}  // namespace varimesh::server
