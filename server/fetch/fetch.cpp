#include "server/fetch/fetch.h"

#include "server/fetch/curl_request.h"

namespace varimesh::server {

bool can_fetch() { return true; }

Expected<std::string> fetch(const std::string& url, const std::string& authority) {
  constexpr int kOk = 200;
  const auto failed = [&](const std::string& why) {
    return tl::unexpected(Error{Error::Kind::Output, "'" + url + "' cannot be fetched: " + why + "."});
  };
  auto response = CurlRequest(url, authority, "https").perform();
  if (!response) return failed(response.error());
  if (response->status != kOk) return failed("the answer has the status " + std::to_string(response->status));
  return std::move(response->body);
}

}  // namespace varimesh::server
