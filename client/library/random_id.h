// Identifiers for uploads and requests.
#pragma once

#include <string>

namespace varimesh::client {

/// 32 random hexadecimal digits.
std::string random_id();

}  // namespace varimesh::client
