// A build without libcurl fetches nothing.
#include "server/fetch/fetch.h"

namespace varimesh::server {

bool can_fetch() { return false; }

Expected<std::string> fetch(const std::string& url, const std::string&) {
  return tl::unexpected(Error{Error::Kind::Output, "'" + url + "' cannot be fetched by a build without libcurl."});
}

}  // namespace varimesh::server
