// A form with files, read as it comes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "server/http/exchange.h"

namespace varimesh::server {

/// Reads the body of a request of the type multipart/form-data (RFC 7578), part by part, and never holds more than two
/// pieces of it. Errors: INVALID_ARGUMENT if the body is no such form, or does not come soon.
class Multipart {
 public:
  explicit Multipart(HttpExchange& exchange);

  /// Skips what is left of this part, and returns the name of the next one; empty if there is none.
  Answer<std::string> next();
  /// Returns the next bytes of the part, which are valid until the next call; none at its end.
  Answer<std::string_view> read();
  /// INVALID_ARGUMENT unless this part is the last one.
  Answer<void> end();

 private:
  /// Reads more of the body.
  Answer<void> fill();

  HttpExchange& exchange_;
  std::string delimiter_;  ///< What ends a part; empty: the request does not say.
  std::int64_t left_;      ///< Bytes of the body that were not read.
  std::string buffer_;
  std::size_t begin_ = 0;  ///< What comes before in the buffer was given out.
};

}  // namespace varimesh::server
