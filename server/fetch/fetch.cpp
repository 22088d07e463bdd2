// One request of libcurl.
#include "server/fetch/fetch.h"

#include <curl/curl.h>

#include <memory>

namespace varimesh::server {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 20;
constexpr long kConnectMilliseconds = 5'000, kMilliseconds = 10'000;
constexpr long kOk = 200;

std::size_t take_body(char* bytes, std::size_t one, std::size_t count, void* to) {
  auto& body = *static_cast<std::string*>(to);
  if (body.size() + one * count > kMostBytes) return 0;
  body.append(bytes, one * count);
  return one * count;
}

}  // namespace

bool can_fetch() { return true; }

Expected<std::string> fetch(const std::string& url, const std::string& authority) {
  static const CURLcode started = curl_global_init(CURL_GLOBAL_ALL);
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> handle(curl_easy_init(), curl_easy_cleanup);
  const auto failed = [&](const std::string& why) {
    return tl::unexpected(Error{Error::Kind::Output, "'" + url + "' cannot be fetched: " + why + "."});
  };
  if (started != CURLE_OK || handle == nullptr) return failed("libcurl cannot begin a request");
  std::string body;
  char why[CURL_ERROR_SIZE] = "";
  curl_easy_setopt(handle.get(), CURLOPT_URL, url.c_str());
  curl_easy_setopt(handle.get(), CURLOPT_PROTOCOLS_STR, "https");
  curl_easy_setopt(handle.get(), CURLOPT_FOLLOWLOCATION, 0L);
  curl_easy_setopt(handle.get(), CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle.get(), CURLOPT_CONNECTTIMEOUT_MS, kConnectMilliseconds);
  curl_easy_setopt(handle.get(), CURLOPT_TIMEOUT_MS, kMilliseconds);
  curl_easy_setopt(handle.get(), CURLOPT_MAXFILESIZE, static_cast<long>(kMostBytes));
  curl_easy_setopt(handle.get(), CURLOPT_USERAGENT, "varimeshd");
  curl_easy_setopt(handle.get(), CURLOPT_ERRORBUFFER, why);
  curl_easy_setopt(handle.get(), CURLOPT_WRITEFUNCTION, take_body);
  curl_easy_setopt(handle.get(), CURLOPT_WRITEDATA, &body);
  if (!authority.empty()) {
    curl_easy_setopt(handle.get(), CURLOPT_CAINFO, authority.c_str());
    curl_easy_setopt(handle.get(), CURLOPT_CAPATH, nullptr);
  }
  const CURLcode code = curl_easy_perform(handle.get());
  if (code != CURLE_OK) return failed(*why != '\0' ? why : curl_easy_strerror(code));
  long status = 0;
  curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &status);
  if (status != kOk) return failed("the answer has the status " + std::to_string(status));
  return body;
}

}  // namespace varimesh::server
