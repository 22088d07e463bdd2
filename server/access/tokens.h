// Bearer tokens: how they are made, and the file that says whose they are.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/error.h"
#include "server/access/rights.h"

namespace varimesh::server {

using WallTime = std::chrono::system_clock::time_point;

/// Who a token belongs to, and what it allows.
struct Principal {
  std::string name;
  Rights rights;
};

/// The tokens of a file. A line is
///
///   NAME ROLES SHA-256 [UNTIL]
///
/// with the roles separated by commas, the SHA-256 of the token in hexadecimal digits and, if the token expires, the
/// time in UTC (2027-01-31 or 2027-01-31T12:00:00Z). "#" begins a comment. A name may have several tokens.
class Tokens {
 public:
  /// Errors: BadOption, which names the line and never quotes it, since somebody may have put a token into it.
  static Expected<Tokens> parse(std::string_view text);

  /// Returns whose token this is; nothing if it is unknown or has expired. Takes the same time for every token.
  std::optional<Principal> find(std::string_view token, WallTime now) const;
  std::size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    Principal principal;
    std::string digest;  ///< SHA-256 of the token.
    std::optional<WallTime> until;
  };

  std::vector<Entry> entries_;
};

/// Returns the time of 2027-01-31 (its beginning) or 2027-01-31T12:00:00Z, in UTC; nothing for any other text. A time
/// after 2262, the end of the clock, is its end.
std::optional<WallTime> time_of(std::string_view text);

/// A new token, and its line for the file.
struct NewToken {
  std::string token;
  std::string line;
};

/// Makes a random token of 256 bits. Errors: BadOption if the name, a role or the time cannot be in a file of tokens.
Expected<NewToken> make_token(const std::string& name, const std::vector<std::string>& roles, const std::string& until);

}  // namespace varimesh::server
