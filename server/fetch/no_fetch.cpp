// A build without libcurl fetches and sends nothing.
#include "server/fetch/fetch.h"
#include "server/fetch/post.h"

namespace varimesh::server {

bool can_fetch() { return false; }

Expected<std::string> fetch(const std::string& url, const std::string&) {
  return tl::unexpected(Error{Error::Kind::Output, "'" + url + "' cannot be fetched by a build without libcurl."});
}

Expected<int> post(const PostRequest&) {
  return tl::unexpected(Error{Error::Kind::Output, "A build without libcurl calls nobody."});
}

}  // namespace varimesh::server
