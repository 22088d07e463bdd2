#include "server/fetch/post.h"

#include <sys/socket.h>
#include <unistd.h>

#include "server/fetch/curl_request.h"
#include "server/fetch/public_address.h"

namespace varimesh::server {
namespace {

/// Opens the socket of a connection, whose address libcurl has just looked up, unless the address is not public.
curl_socket_t open_public(void* refused, curlsocktype, curl_sockaddr* address) {
  if (is_public(address->addr)) return ::socket(address->family, address->socktype, address->protocol);
  *static_cast<bool*>(refused) = true;
  return CURL_SOCKET_BAD;
}

std::size_t drop_body(char*, std::size_t one, std::size_t count, void*) { return one * count; }

int is_given_up(void* request, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  return static_cast<const PostRequest*>(request)->given_up() ? 1 : 0;
}

}  // namespace

Expected<int> post(const PostRequest& request) {
  CurlRequest curl(request.url, request.authority, "http,https");
  struct FreeList {
    void operator()(curl_slist* list) const { curl_slist_free_all(list); }
  };
  std::unique_ptr<curl_slist, FreeList> headers;
  const auto add = [&](const std::string& header) {
    headers.reset(curl_slist_append(headers.release(), header.c_str()));
  };
  add("Expect:");  // the body is sent at once
  for (const std::string& header : request.headers) add(header);
  bool refused = false;
  if (CURL* const handle = curl.handle(); handle != nullptr) {
    curl_easy_setopt(handle, CURLOPT_PROXY, "");
    curl_easy_setopt(handle, CURLOPT_HTTPHEADER, headers.get());
    curl_easy_setopt(handle, CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(request.body.size()));
    curl_easy_setopt(handle, CURLOPT_POSTFIELDS, request.body.c_str());
    curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, drop_body);
    curl_easy_setopt(handle, CURLOPT_MAXFILESIZE, 0L);
    if (request.given_up) {
      curl_easy_setopt(handle, CURLOPT_NOPROGRESS, 0L);
      curl_easy_setopt(handle, CURLOPT_XFERINFOFUNCTION, is_given_up);
      curl_easy_setopt(handle, CURLOPT_XFERINFODATA, &request);
    }
    if (!request.may_be_private) {
      curl_easy_setopt(handle, CURLOPT_OPENSOCKETFUNCTION, open_public);
      curl_easy_setopt(handle, CURLOPT_OPENSOCKETDATA, &refused);
    }
  }
  const auto response = curl.perform();
  // A receiver with several addresses may have answered at another one.
  if (!response && refused)
    return tl::unexpected(Error{Error::Kind::Output,
                                "The receiver has an address that is not public, and its line in the file of "
                                "--webhooks does not say 'private'."});
  if (!response) return tl::unexpected(Error{Error::Kind::Output, "There was no answer: " + response.error() + "."});
  return response->status;
}

}  // namespace varimesh::server
