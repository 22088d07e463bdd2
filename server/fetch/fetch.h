// Fetches small documents over HTTPS.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Whether this build can fetch anything.
bool can_fetch();

/// Returns the document at an address that begins with https://. `authority`: a file with the authorities that the
/// other server's certificate may come from, in PEM; empty: the machine's authorities. It follows no redirection,
/// waits for ten seconds and takes at most 1 MiB. Errors: Output, with the address and the reason.
Expected<std::string> fetch(const std::string& url, const std::string& authority);

}  // namespace varimesh::server
