// libjwt checks the signatures; the claims are checked here.
#include "server/access/json_web_tokens.h"

#include <jwt.h>
#include <openssl/bn.h>
#include <openssl/core_names.h>
#include <openssl/evp.h>
#include <openssl/param_build.h>
#include <openssl/pem.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <sstream>
#include <utility>
#include <vector>

namespace varimesh::server {
namespace {

using Json = nlohmann::json;

constexpr std::size_t kMostTokenBytes = 16 * 1024;
constexpr std::size_t kMostOwnerBytes = 128;
constexpr int kLeastRsaBits = 2048;
/// How far the clocks of the issuer and of this machine may be apart.
constexpr std::chrono::seconds kLeeway{60};

struct Freer {
  void operator()(jwt_t* token) const { jwt_free(token); }
  void operator()(char* text) const { std::free(text); }  // as libjwt has made it
  void operator()(BIGNUM* number) const { BN_free(number); }
  void operator()(OSSL_PARAM_BLD* builder) const { OSSL_PARAM_BLD_free(builder); }
  void operator()(OSSL_PARAM* parameters) const { OSSL_PARAM_free(parameters); }
  void operator()(EVP_PKEY_CTX* context) const { EVP_PKEY_CTX_free(context); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  void operator()(BIO* file) const { BIO_free_all(file); }
};
template <class T>
using Owned = std::unique_ptr<T, Freer>;

/// Decodes base64url without padding (RFC 7515). Nothing for any other text.
std::optional<std::string> decoded(std::string_view text) {
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  if (text.size() % 4 == 1) return std::nullopt;
  std::string bytes;
  unsigned bits = 0, kept = 0;
  for (const char c : text) {
    const auto value = letters.find(c);
    if (value == std::string_view::npos) return std::nullopt;
    kept = (kept << 6U | static_cast<unsigned>(value)) & 0xFFFFU;
    if ((bits += 6) >= 8) bytes += static_cast<char>(kept >> (bits -= 8) & 0xFFU);
  }
  return bytes;
}

/// Returns a member that is text; nothing if it is not.
std::optional<std::string> text_of(const Json& object, const std::string& name) {
  const auto found = object.is_object() ? object.find(name) : object.end();
  if (!object.is_object() || found == object.end() || !found->is_string()) return std::nullopt;
  return found->get<std::string>();
}

std::optional<std::string> bytes_of(const Json& object, const char* name) {
  const auto text = text_of(object, name);
  auto bytes = text ? decoded(*text) : std::nullopt;
  return bytes && !bytes->empty() ? bytes : std::nullopt;
}

Owned<BIGNUM> number_of(const std::string& bytes) {
  return Owned<BIGNUM>(
      BN_bin2bn(reinterpret_cast<const unsigned char*>(bytes.data()), static_cast<int>(bytes.size()), nullptr));
}

/// The public key of these parameters, in PEM; empty if there is none.
std::string pem_of(const char* type, OSSL_PARAM_BLD* builder, int least_bits) {
  const Owned<OSSL_PARAM> parameters(OSSL_PARAM_BLD_to_param(builder));
  const Owned<EVP_PKEY_CTX> context(EVP_PKEY_CTX_new_from_name(nullptr, type, nullptr));
  EVP_PKEY* made = nullptr;
  if (parameters == nullptr || context == nullptr || EVP_PKEY_fromdata_init(context.get()) != 1 ||
      EVP_PKEY_fromdata(context.get(), &made, EVP_PKEY_PUBLIC_KEY, parameters.get()) != 1)
    return {};
  const Owned<EVP_PKEY> key(made);
  const Owned<BIO> memory(BIO_new(BIO_s_mem()));
  if (EVP_PKEY_get_bits(key.get()) < least_bits || PEM_write_bio_PUBKEY(memory.get(), key.get()) != 1) return {};
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory.get(), &data);
  return std::string(data, static_cast<std::size_t>(size));
}

std::string rsa_pem(const Json& key) {
  const auto modulus = bytes_of(key, "n"), exponent = bytes_of(key, "e");
  if (!modulus || !exponent) return {};
  const Owned<BIGNUM> n = number_of(*modulus), e = number_of(*exponent);
  const Owned<OSSL_PARAM_BLD> builder(OSSL_PARAM_BLD_new());
  if (n == nullptr || e == nullptr || builder == nullptr ||
      OSSL_PARAM_BLD_push_BN(builder.get(), OSSL_PKEY_PARAM_RSA_N, n.get()) != 1 ||
      OSSL_PARAM_BLD_push_BN(builder.get(), OSSL_PKEY_PARAM_RSA_E, e.get()) != 1)
    return {};
  return pem_of("RSA", builder.get(), kLeastRsaBits);
}

std::string ec_pem(const Json& key) {
  constexpr std::size_t kCoordinateBytes = 32;
  const auto x = bytes_of(key, "x"), y = bytes_of(key, "y");
  if (text_of(key, "crv") != "P-256" || !x || !y || x->size() != kCoordinateBytes || y->size() != kCoordinateBytes)
    return {};
  const std::string point = '\x04' + *x + *y;  // not compressed
  const Owned<OSSL_PARAM_BLD> builder(OSSL_PARAM_BLD_new());
  if (builder == nullptr ||
      OSSL_PARAM_BLD_push_utf8_string(builder.get(), OSSL_PKEY_PARAM_GROUP_NAME, "prime256v1", 0) != 1 ||
      OSSL_PARAM_BLD_push_octet_string(builder.get(), OSSL_PKEY_PARAM_PUB_KEY, point.data(), point.size()) != 1)
    return {};
  return pem_of("EC", builder.get(), 256);
}

bool is_for(const Json& claims, const std::string& audience) {
  const auto found = claims.find("aud");
  if (found == claims.end()) return false;
  if (found->is_array()) return std::ranges::find(*found, Json(audience)) != found->end();
  return *found == audience;
}

/// A claim that is a time, in seconds since 1970; nothing if there is none. A time that is no number is long ago.
std::optional<double> time_of_claim(const Json& claims, const char* name) {
  const auto found = claims.find(name);
  if (found == claims.end()) return std::nullopt;
  return found->is_number() ? found->get<double>() : 0.0;
}

bool is_valid_at(const Json& claims, WallTime now) {
  const double seconds = std::chrono::duration<double>(now.time_since_epoch()).count();
  const double leeway = std::chrono::duration<double>(kLeeway).count();
  const auto ends = time_of_claim(claims, "exp"), begins = time_of_claim(claims, "nbf");
  return ends && *ends > seconds && (!begins || (*begins > 0 && *begins <= seconds + leeway));
}

Rights rights_of(const Json& claims, const std::string& name) {
  std::vector<std::string> words;
  if (const auto found = claims.find(name); found != claims.end() && found->is_array()) {
    for (const Json& one : *found)
      if (one.is_string()) words.push_back(one.get<std::string>());
  } else if (found != claims.end() && found->is_string()) {
    std::istringstream text(found->get<std::string>());
    for (std::string word; text >> word;) words.push_back(std::move(word));
  }
  Rights rights;
  for (const std::string& word : words)
    if (const auto right = right_of(word)) rights = rights | *right;
  return rights;
}

/// The header of a token that looks like one; nothing that is an object if it cannot be read.
Json header_of(std::string_view token) {
  const auto text = decoded(token.substr(0, token.find('.')));
  return text ? Json::parse(*text, nullptr, false) : Json();
}

bool is_owner(const std::string& name) {
  return !name.empty() && name.size() <= kMostOwnerBytes &&
         std::ranges::all_of(name, [](char c) { return c > ' ' && c < '\x7f'; });
}

}  // namespace

struct JsonWebTokens::Keys {
  struct Key {
    std::string id;  ///< Empty: none.
    jwt_alg_t algorithm;
    std::string pem;
  };
  std::vector<Key> all;
};

JsonWebTokens::JsonWebTokens(JsonWebTokenSettings settings, std::unique_ptr<Keys> keys)
    : settings_(std::move(settings)), keys_(std::move(keys)) {}

JsonWebTokens::~JsonWebTokens() = default;

bool JsonWebTokens::available() { return true; }

Expected<std::shared_ptr<const JsonWebTokens>> JsonWebTokens::parse(const JsonWebTokenSettings& settings,
                                                                    const std::string& key_set) {
  if ((settings.keys.empty() && !settings.are_fetched()) || settings.issuer.empty() || settings.audience.empty())
    return bad_option(
        "JSON Web Tokens need --jwt-issuer, --jwt-audience and, unless the issuer begins with https://, --jwt-keys.");
  const std::string what = settings.keys.empty()    ? "What the issuer '" + settings.issuer + "' names as its keys"
                           : settings.are_fetched() ? "What '" + settings.keys + "' has"
                                                    : "The file '" + settings.keys + "' of --jwt-keys";
  const Json set = Json::parse(key_set, nullptr, false);
  const auto found = set.is_object() ? set.find("keys") : set.end();
  if (!set.is_object() || found == set.end() || !found->is_array())
    return bad_option(what + " is no JSON Web Key Set ({\"keys\": [...]}).");
  auto keys = std::make_unique<Keys>();
  for (const Json& key : *found) {
    if (text_of(key, "use").value_or("sig") != "sig") continue;
    const auto type = text_of(key, "kty");
    const std::string name = type == "RSA" ? "RS256" : "ES256";
    if (text_of(key, "alg").value_or(name) != name) continue;
    std::string pem = type == "RSA" ? rsa_pem(key) : type == "EC" ? ec_pem(key) : "";
    if (pem.empty()) continue;
    keys->all.push_back(
        {text_of(key, "kid").value_or(""), type == "RSA" ? JWT_ALG_RS256 : JWT_ALG_ES256, std::move(pem)});
  }
  if (keys->all.empty())
    return bad_option(what + " has no key for RS256 (RSA with at least 2048 bits) or ES256 (P-256).");
  return std::shared_ptr<const JsonWebTokens>(new JsonWebTokens(settings, std::move(keys)));
}

bool JsonWebTokens::looks_like_one(std::string_view token) {
  return token.size() <= kMostTokenBytes && std::ranges::count(token, '.') == 2 && token.find('\0') == token.npos;
}

bool JsonWebTokens::lacks_key_of(std::string_view token) const {
  if (!looks_like_one(token)) return false;
  const auto id = text_of(header_of(token), "kid");
  return id && std::ranges::none_of(keys_->all, [&](const Keys::Key& key) { return key.id == *id; });
}

std::optional<Principal> JsonWebTokens::find(std::string_view token, WallTime now) const {
  if (!looks_like_one(token)) return std::nullopt;
  const Json header = header_of(token);
  const auto named = text_of(header, "alg");
  // What a token may be signed by is decided here, and not by the token.
  if (named != "RS256" && named != "ES256") return std::nullopt;
  const jwt_alg_t algorithm = named == "RS256" ? JWT_ALG_RS256 : JWT_ALG_ES256;
  if (header.contains("crit")) return std::nullopt;  // an extension that must be understood
  const auto id = text_of(header, "kid");
  const std::string whole(token);
  for (const Keys::Key& key : keys_->all) {
    if (key.algorithm != algorithm || (id && !key.id.empty() && *id != key.id)) continue;
    jwt_t* decoded_token = nullptr;
    const int failed = jwt_decode(&decoded_token, whole.c_str(), reinterpret_cast<const unsigned char*>(key.pem.data()),
                                  static_cast<int>(key.pem.size()));
    const Owned<jwt_t> checked(failed == 0 ? decoded_token : nullptr);
    if (checked == nullptr || jwt_get_alg(checked.get()) != algorithm) continue;
    const Owned<char> said(jwt_get_grants_json(checked.get(), nullptr));
    const Json claims = said == nullptr ? Json() : Json::parse(said.get(), nullptr, false);
    const auto owner = text_of(claims, settings_.owner_claim);
    if (text_of(claims, "iss") != settings_.issuer || !is_for(claims, settings_.audience) ||
        !is_valid_at(claims, now) || !owner || !is_owner(*owner))
      return std::nullopt;
    return Principal{*owner, rights_of(claims, settings_.roles_claim)};
  }
  return std::nullopt;
}

}  // namespace varimesh::server
