// The description of --http for programs.
#pragma once

#include <string>

namespace varimesh::server {

/// Returns an OpenAPI 3.1 document, as JSON: the addresses by the table of routes, the messages by the contract's
/// descriptors as proto3 JSON has them, and with the comments of the contract. It is made once.
const std::string& openapi_document();

}  // namespace varimesh::server
