// One request of libcurl, as this server makes them: without redirections, for a short time. Internal to server/fetch.
#pragma once

#include <curl/curl.h>

#include <memory>
#include <string>

#include "core/base/error.h"

namespace varimesh::server {

class CurlRequest {
 public:
  /// `authority`: as in fetch(). `protocols`: those that the address may have, with commas between them.
  CurlRequest(const std::string& url, const std::string& authority, const char* protocols);

  /// Null: libcurl cannot begin a request. For further options.
  CURL* handle() const { return handle_.get(); }
  struct Response {
    int status = 0;
    std::string body;  ///< At most 1 MiB; a longer one is an error.
  };
  /// Errors: why there is no answer, as a part of a sentence.
  tl::expected<Response, std::string> perform();

 private:
  const std::unique_ptr<CURL, decltype(&curl_easy_cleanup)> handle_;
  Response response_;
  char why_[CURL_ERROR_SIZE] = "";
};

}  // namespace varimesh::server
