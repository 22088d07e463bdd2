// JSON Web Tokens of an OpenID Connect issuer, as bearer tokens.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "server/access/tokens.h"

namespace varimesh::server {

/// Whose tokens are accepted, and what they say.
struct JsonWebTokenSettings {
  std::string keys;    ///< A file with the issuer's public keys: a JSON Web Key Set (RFC 7517). Empty: no such tokens.
  std::string issuer;  ///< What the claim "iss" must be.
  std::string audience;               ///< What the claim "aud" must be or contain.
  std::string owner_claim = "sub";    ///< The claim that says whose a token is.
  std::string roles_claim = "roles";  ///< The claim with the roles: a list, or words with spaces between them.

  bool are_given() const { return !keys.empty() || !issuer.empty() || !audience.empty(); }
};

/// Checks tokens with the keys of a set. Only the signatures RS256 (keys of at least 2048 bits) and ES256 (P-256) are
/// accepted, whatever a token says of itself. Thread-safe.
class JsonWebTokens {
 public:
  /// Whether this build can check tokens.
  static bool available();
  /// `key_set`: the text of the file. Errors: BadOption if a setting is missing, if the text is no key set or has no
  /// key that can be used, or if this build cannot check tokens.
  static Expected<std::shared_ptr<const JsonWebTokens>> parse(const JsonWebTokenSettings& settings,
                                                              const std::string& key_set);
  ~JsonWebTokens();
  JsonWebTokens(const JsonWebTokens&) = delete;
  JsonWebTokens& operator=(const JsonWebTokens&) = delete;

  /// Returns whose token this is; nothing unless it was signed by one of the keys, is of the issuer, for the audience,
  /// and neither expired nor from the future by more than a minute. A token must say when it expires. Roles that the
  /// server does not have are ignored.
  std::optional<Principal> find(std::string_view token, WallTime now) const;

 private:
  struct Keys;
  JsonWebTokens(JsonWebTokenSettings settings, std::unique_ptr<Keys> keys);

  const JsonWebTokenSettings settings_;
  const std::unique_ptr<Keys> keys_;
};

}  // namespace varimesh::server
