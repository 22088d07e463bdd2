// JSON Web Tokens of an OpenID Connect issuer, as bearer tokens.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/error.h"
#include "server/access/tokens.h"

namespace varimesh::server {

/// Whether this is an address that documents are fetched from.
inline bool is_https(std::string_view text) { return text.starts_with("https://"); }

/// Whose tokens are accepted, and what they say.
struct JsonWebTokenSettings {
  std::string keys;  ///< The issuer's public keys, a JSON Web Key Set (RFC 7517): a file, or an address with https://.
                     ///< Empty: the issuer's configuration says where they are.
  std::string issuer;                 ///< What the claim "iss" must be.
  std::string audience;               ///< What the claim "aud" must be or contain.
  std::string owner_claim = "sub";    ///< The claim with the owner of a token.
  std::string roles_claim = "roles";  ///< The claim with the roles: a list, or words with spaces between them.
  /// A file with the authorities of the server that keys are fetched from. Empty: the machine's.
  std::string authority = {};
  /// Returns the document at an address, whose server has a certificate of the authority.
  std::function<Expected<std::string>(const std::string& url, const std::string& authority)> fetch = {};

  bool are_given() const { return !keys.empty() || !issuer.empty() || !audience.empty(); }
  bool are_fetched() const { return is_https(keys) || (keys.empty() && is_https(issuer)); }
};

/// Checks tokens with the keys of a set. Only the signatures RS256 (keys of at least 2048 bits) and ES256 (P-256) are
/// accepted, whatever a token says of itself. Thread-safe.
class JsonWebTokens {
 public:
  /// Whether this build can check tokens.
  static bool available();
  /// Whether a bearer token has the form of a JSON Web Token.
  static bool looks_like_one(std::string_view token);
  /// `key_set`: the text of the keys. Errors: BadOption if a setting is missing, if the text is no key set or has no
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
  /// Whether the token names a key that is not in the set.
  bool lacks_key_of(std::string_view token) const;

 private:
  struct Keys;
  JsonWebTokens(JsonWebTokenSettings settings, std::unique_ptr<Keys> keys);

  const JsonWebTokenSettings settings_;
  const std::unique_ptr<Keys> keys_;
};

}  // namespace varimesh::server
