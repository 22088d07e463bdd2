// Checks the signatures of requests as an S3 server does. s3rver takes every signature of version 4, so the tests'
// proxy checks them.
#pragma once

#include <string>
#include <string_view>

namespace varimesh::server::testing {

/// Whether the head of a request, up to its empty line, has the signature (AWS version 4) that this secret makes.
/// https://docs.aws.amazon.com/AmazonS3/latest/API/sig-v4-header-based-auth.html
bool is_signed(std::string_view head, const std::string& secret);

}  // namespace varimesh::server::testing
