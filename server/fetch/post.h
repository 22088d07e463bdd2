// Sends small documents to other servers.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh::server {

/// What is sent, and where.
struct PostRequest {
  std::string url;                   ///< Begins with http:// or https://.
  std::vector<std::string> headers;  ///< "NAME: VALUE".
  std::string body;
  std::string authority;           ///< As in fetch(): a file with authorities, in PEM; empty: those of the machine.
  bool may_be_private = false;     ///< The server may have an address that is not public (public_address.h).
  std::function<bool()> given_up;  ///< Asked about once per second; if it says yes, the call ends without an answer.
};

/// Sends the body with POST, and returns the status of the answer, whatever it is. It follows no redirection, uses no
/// proxy, and waits for ten seconds. The address is looked at when the connection is opened, so that a name that
/// changes its meaning meanwhile leads nowhere else. Errors: Output, with the host and the reason.
Expected<int> post(const PostRequest& request);

}  // namespace varimesh::server
