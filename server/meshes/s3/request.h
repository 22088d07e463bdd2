// One request of an S3 server, and its answer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/meshes/s3/client.h"

namespace varimesh::server {

struct S3Client::Request {
  std::string method;
  std::string key = {};        ///< Whole, with the prefix; empty: the bucket itself.
  std::string query = {};      ///< As it stands in the URL: sorted by keys, each with a "=".
  std::string_view body = {};  ///< Sent again with each try.
  std::vector<std::string> headers = {};
  std::string end = {};        ///< What the answer's body must contain, otherwise it is taken to be cut.
  std::int64_t expected = -1;  ///< The size of the answer's body, which is otherwise taken to be cut. −1: not known.
};

struct S3Client::Response {
  long status = 0;  ///< 0: no answer; `error` says why.
  std::string body;
  std::string tag;  ///< ETag.
  std::string error;
  bool is_permanent = false;  ///< The same request cannot succeed, such as with a wrong certificate.
};

}  // namespace varimesh::server
