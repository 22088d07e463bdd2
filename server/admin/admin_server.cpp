// Answers HTTP requests, with civetweb.
#include "server/admin/admin_server.h"

#include <civetweb.h>

#include <array>
#include <charconv>
#include <cstring>
#include <string_view>

#include "server/admin/page_files.h"
#include "web/files.h"

namespace varimesh::server {
namespace {

const std::array<PageFile, 3> kFiles{
    PageFile{"/", kHtmlType, {&page::watch_html}},
    PageFile{"/watch.css", kStyleType, {&web::theme_css, &page::watch_css}},
    PageFile{"/watch.js",
             kScriptType,
             {&web::dom_js, &web::numbers_js, &web::axes_js, &web::charts_js, &page::curves_js, &page::watch_js}}};

/// Returns a field of the query string, decoded; empty if it is missing.
std::string field(const mg_request_info& request, const char* name) {
  if (request.query_string == nullptr) return {};
  std::array<char, 512> value{};
  const int length =
      mg_get_var(request.query_string, std::strlen(request.query_string), name, value.data(), value.size());
  return length > 0 ? std::string(value.data(), static_cast<std::size_t>(length)) : std::string();
}

void refuse(mg_connection* connection, const Failure& why) {
  const int status = why.code == Failure::Code::NotFound           ? 404
                     : why.code == Failure::Code::Unauthenticated  ? 401
                     : why.code == Failure::Code::PermissionDenied ? 403
                                                                   : 503;
  send_http(connection, status, kTextType, why.sentence + "\n", status == 401 ? "WWW-Authenticate: Bearer\r\n" : "");
}

void send(mg_connection* connection, const Answer<std::string>& document) {
  if (document) return send_http(connection, 200, kJsonType, *document);
  refuse(connection, document.error());
}

/// Whether a page of this very port has sent the request, and no other page of the browser.
bool is_from_own_page(const mg_connection* connection) {
  const char* const host = mg_get_header(connection, "Host");
  const char* const origin = mg_get_header(connection, "Origin");
  const char* const site = mg_get_header(connection, "Sec-Fetch-Site");
  if (host == nullptr || origin == nullptr || std::string("http://") + host != origin) return false;
  return site == nullptr || std::string_view(site) == "same-origin";
}

}  // namespace

Expected<std::unique_ptr<AdminServer>> AdminServer::start(const std::string& address,
                                                          std::unique_ptr<LiveStatus> live_status,
                                                          std::function<bool()> ready, Admit admit) {
  const auto not_loopback = bad_option("Only this machine may use the admin port, but '" + address +
                                       "' is not a loopback address with a port; write --admin 127.0.0.1:9464.");
  if (!is_own_host(address.c_str())) return not_loopback;
  std::unique_ptr<AdminServer> admin(new AdminServer(std::move(live_status), std::move(ready), std::move(admit)));
  const auto listening = admin->http_.listen(address, "--admin", handle, admin.get());
  if (!listening)
    return listening.error().kind == Error::Kind::BadOption ? not_loopback : tl::unexpected(listening.error());
  return admin;
}

int AdminServer::handle(mg_connection* connection) {
  const auto* admin = static_cast<const AdminServer*>(mg_get_request_info(connection)->user_data);
  try {
    admin->answer(connection);
  } catch (const std::exception&) {  // out of memory, if anything; the page asks again
    send_http(connection, 503, kTextType, "The server cannot answer now; try again.\n");
  }
  return 1;  // every request has been answered
}

void AdminServer::answer(mg_connection* connection) const {
  const mg_request_info& request = *mg_get_request_info(connection);
  const std::string_view method = request.request_method, path = request.local_uri;
  if (!is_own_host(mg_get_header(connection, "Host")))
    return send_http(connection, 421, kTextType, "Only this machine may use this port; use the address 127.0.0.1.\n");
  if (path == "/api/cancel") {
    if (method == "POST") return cancel(connection);
    return send_http(connection, 405, kTextType, "A cancel is a POST.\n", "Allow: POST\r\n");
  }
  if (method != "GET" && method != "HEAD")
    return send_http(connection, 405, kTextType, "This address is read-only; use gRPC to submit jobs.\n",
                     "Allow: GET, HEAD\r\n");
  if (const PageFile* file = find_page_file(kFiles, path)) return send_page_file(connection, *file);
  if (path == "/healthz/live") return send_http(connection, 200, kTextType, "live\n");
  if (path == "/healthz/ready") {
    const bool ready = ready_();
    return send_http(connection, ready ? 200 : 503, kTextType, ready ? "ready\n" : "not ready\n");
  }
  if (path.starts_with("/api/")) return answer_about_jobs(connection);
  send_http(connection, 404, kTextType, "There is nothing at this address.\n");
}

void AdminServer::cancel(mg_connection* connection) const {
  if (!is_from_own_page(connection))
    return send_http(connection, 403, kTextType, "Only the page of this port may cancel jobs here.\n");
  const char* authorization = mg_get_header(connection, "Authorization");
  const auto view = admit_(Method::LivePageCancel, authorization == nullptr ? "" : authorization);
  if (!view) return refuse(connection, view.error());
  const auto cancelled = view->cancel(field(*mg_get_request_info(connection), "job"));
  if (!cancelled) return refuse(connection, cancelled.error());
  send_http(connection, 204, kTextType, "");
}

void AdminServer::answer_about_jobs(mg_connection* connection) const {
  const mg_request_info& request = *mg_get_request_info(connection);
  const std::string_view path = request.local_uri;
  const char* authorization = mg_get_header(connection, "Authorization");
  const auto view = admit_(Method::LivePage, authorization == nullptr ? "" : authorization);
  if (!view) return refuse(connection, view.error());
  if (path == "/api/status") return send(connection, live_status_->status(*view));
  if (path == "/api/iterations") {
    const std::string after = field(request, "after");
    std::int64_t number = 0;
    std::from_chars(after.data(), after.data() + after.size(), number);
    return send(connection, LiveStatus::iterations(*view, field(request, "job"), number));
  }
  send_http(connection, 404, kTextType, "There is nothing at this address.\n");
}

}  // namespace varimesh::server
