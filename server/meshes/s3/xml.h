// What is read of the answers of an S3 server.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "server/failure.h"

namespace varimesh::server {

/// An object of a bucket, as a list shows it.
struct S3Object {
  std::string key;  ///< Without the prefix of the address.
  std::int64_t size = 0;
  std::string tag;           ///< Differs if the bytes differ.
  std::int64_t changed = 0;  ///< When it was stored, in nanoseconds since 1970, on the clock of the S3 server.
};

/// One page of a list.
struct S3Page {
  std::vector<S3Object> objects;
  std::string next;  ///< Where the next page begins; empty: there is none.
};

/// The text of the first element with this name; empty if there is none. Elements of this name do not contain each
/// other.
std::string text_of(std::string_view xml, std::string_view name);

/// Reads an answer of ListObjectsV2. `prefix` is removed from the keys.
S3Page parse_page(std::string_view xml, std::string_view prefix);

/// Collects a list of several pages. Errors: those of `fetch`; INTERNAL for a server that sends a page again, whose
/// list would fill the memory.
/// @param fetch  returns the page that begins there; empty: the first one
Answer<std::vector<S3Object>> all_pages(const std::function<Answer<S3Page>(const std::string& next)>& fetch);

/// Reads a time as "2026-02-03T04:05:06.789Z". 0 if it is none.
std::int64_t parse_time(const std::string& text);

}  // namespace varimesh::server
