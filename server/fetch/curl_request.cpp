#include "server/fetch/curl_request.h"

namespace varimesh::server {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 20;
constexpr long kConnectMilliseconds = 5'000, kMilliseconds = 10'000;

std::size_t take_body(char* bytes, std::size_t one, std::size_t count, void* to) {
  auto& body = *static_cast<std::string*>(to);
  if (body.size() + one * count > kMostBytes) return 0;
  body.append(bytes, one * count);
  return one * count;
}

CURL* begin() {
  static const CURLcode started = curl_global_init(CURL_GLOBAL_ALL);
  return started == CURLE_OK ? curl_easy_init() : nullptr;
}

}  // namespace

CurlRequest::CurlRequest(const std::string& url, const std::string& authority, const char* protocols)
    : handle_(begin(), curl_easy_cleanup) {
  if (handle_ == nullptr) return;
  curl_easy_setopt(handle(), CURLOPT_URL, url.c_str());
  curl_easy_setopt(handle(), CURLOPT_PROTOCOLS_STR, protocols);
  curl_easy_setopt(handle(), CURLOPT_FOLLOWLOCATION, 0L);
  curl_easy_setopt(handle(), CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle(), CURLOPT_CONNECTTIMEOUT_MS, kConnectMilliseconds);
  curl_easy_setopt(handle(), CURLOPT_TIMEOUT_MS, kMilliseconds);
  curl_easy_setopt(handle(), CURLOPT_MAXFILESIZE, static_cast<long>(kMostBytes));
  curl_easy_setopt(handle(), CURLOPT_USERAGENT, "varimeshd");
  curl_easy_setopt(handle(), CURLOPT_ERRORBUFFER, why_);
  curl_easy_setopt(handle(), CURLOPT_WRITEFUNCTION, take_body);
  curl_easy_setopt(handle(), CURLOPT_WRITEDATA, &response_.body);
  if (authority.empty()) return;
  curl_easy_setopt(handle(), CURLOPT_CAINFO, authority.c_str());
  curl_easy_setopt(handle(), CURLOPT_CAPATH, nullptr);
}

tl::expected<CurlRequest::Response, std::string> CurlRequest::perform() {
  if (handle_ == nullptr) return tl::unexpected(std::string("libcurl cannot begin a request"));
  const CURLcode code = curl_easy_perform(handle());
  if (code != CURLE_OK) return tl::unexpected(std::string(*why_ != '\0' ? why_ : curl_easy_strerror(code)));
  long status = 0;
  curl_easy_getinfo(handle(), CURLINFO_RESPONSE_CODE, &status);
  response_.status = static_cast<int>(status);
  return std::move(response_);
}

}  // namespace varimesh::server
