// The page tokens of lists, as callers see them.
#pragma once

#include <string>

#include "server/access/access.h"
#include "server/failure.h"

namespace varimesh::server {

/// A store counts the jobs of all owners, and its page tokens are such counts. This class encrypts them (AES-128), so
/// that nobody learns from them how many jobs others submit. A token is of use to its owner only. Thread-safe.
class PageTokens {
 public:
  /// `secret`: 16 random bytes. Tokens outlive the server if the next one has the same secret.
  explicit PageTokens(std::string secret) : secret_(std::move(secret)) {}

  /// Returns the token for a caller; empty if `token` is. Callers who see all jobs get the token of the store.
  std::string seal(const std::string& token, const Caller& caller) const;
  /// Returns the token of the store. BAD_REQUEST unless seal() has made the token for the same owner.
  Answer<std::string> open(const std::string& sealed, const Caller& caller) const;

 private:
  const std::string secret_;
};

}  // namespace varimesh::server
