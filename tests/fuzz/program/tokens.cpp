// What lets somebody in: files of tokens, key sets and JSON Web Tokens. The first byte says which. A token is taken
// only if it is in the file, or was signed by the key here and says what it must.
#include "server/access/tokens.h"

#include <openssl/bn.h>
#include <openssl/core_names.h>
#include <openssl/ec.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/sha256.h"
#include "server/access/json_web_tokens.h"
#include "tests/fuzz/program/memory.h"
#include "tests/server/access/base64url.h"

namespace {

using namespace varimesh;
using namespace varimesh::server;
using fuzz::expect;
using varimesh::server::testing::base64url;
using Json = nlohmann::json;

const WallTime kNow{std::chrono::seconds(1'800'000'000)};
const std::string kIssuer = "https://issuer.example", kAudience = "varimesh";

// === files of tokens ===

void try_file(const std::string& text) {
  const std::string known = "vm_known", unknown = "vm_unknown";
  const auto tokens = Tokens::parse(text);
  if (!tokens) {
    const std::string& sentence = tokens.error().sentence;
    expect(!sentence.empty() && sentence.size() < 400, "a refusal has no sentence, or a long one");
    return;
  }
  expect(tokens->size() <= 1 + static_cast<std::size_t>(std::ranges::count(text, '\n')), "a line has two tokens");
  const bool names_it = text.find(sha256(known)) != std::string::npos;
  if (text.find(sha256(unknown)) == std::string::npos)
    expect(!tokens->find(unknown, kNow), "a token was found that is not in the file");
  if (names_it) return;
  expect(!tokens->find(known, kNow), "a token was found that is not in the file");
  const auto more = Tokens::parse(text + "\nzoe read " + sha256(known) + " 2030-01-01\n");
  expect(more && more->size() == tokens->size() + 1, "a good line was not read");
  const auto found = more->find(known, kNow);
  expect(found && found->name == "zoe" && found->rights == right_of("read"), "a token has other rights");
  expect(!more->find(known, kNow + std::chrono::hours(24 * 365 * 10)), "an old token was taken");
}

// === JSON Web Tokens ===

/// A key of the issuer, made for this run.
class Signer {
 public:
  Signer() : key_(EVP_EC_gen("P-256")) { expect(key_ != nullptr, "no key can be made"); }
  ~Signer() { EVP_PKEY_free(key_); }

  Json web_key() const {
    return {{"kid", "key"},
            {"kty", "EC"},
            {"crv", "P-256"},
            {"x", number(OSSL_PKEY_PARAM_EC_PUB_X)},
            {"y", number(OSSL_PKEY_PARAM_EC_PUB_Y)}};
  }

  /// The signature of ES256: two numbers of 32 bytes.
  std::string sign(std::string_view text) const {
    EVP_MD_CTX* const context = EVP_MD_CTX_new();
    std::array<unsigned char, 128> der{};
    std::size_t size = der.size();
    const bool done = EVP_DigestSignInit(context, nullptr, EVP_sha256(), nullptr, key_) == 1 &&
                      EVP_DigestSign(context, der.data(), &size, reinterpret_cast<const unsigned char*>(text.data()),
                                     text.size()) == 1;
    EVP_MD_CTX_free(context);
    expect(done, "nothing can be signed");
    const unsigned char* at = der.data();
    ECDSA_SIG* const pair = d2i_ECDSA_SIG(nullptr, &at, static_cast<long>(size));
    std::string bytes(64, '\0');
    auto* const out = reinterpret_cast<unsigned char*>(bytes.data());
    BN_bn2binpad(ECDSA_SIG_get0_r(pair), out, 32);
    BN_bn2binpad(ECDSA_SIG_get0_s(pair), out + 32, 32);
    ECDSA_SIG_free(pair);
    return bytes;
  }

 private:
  std::string number(const char* name) const {
    BIGNUM* value = nullptr;
    expect(EVP_PKEY_get_bn_param(key_, name, &value) == 1, "a key has no numbers");
    std::string bytes(32, '\0');
    BN_bn2binpad(value, reinterpret_cast<unsigned char*>(bytes.data()), 32);
    BN_free(value);
    return base64url(bytes);
  }

  EVP_PKEY* const key_;
};

const Signer& signer() {
  static const Signer one;
  return one;
}

JsonWebTokenSettings settings() { return {"keys.json", kIssuer, kAudience}; }

const JsonWebTokens& issuer() {
  static const auto one = *JsonWebTokens::parse(settings(), Json{{"keys", Json::array({signer().web_key()})}}.dump());
  return *one;
}

/// Whether a token with these claims may be taken.
bool may_enter(const std::string& text, const Principal& who) {
  const Json claims = Json::parse(text, nullptr, false);
  if (!claims.is_object()) return false;
  const Json audience = claims.value("aud", Json()), until = claims.value("exp", Json());
  const bool is_for_us =
      audience == kAudience || (audience.is_array() && std::ranges::find(audience, Json(kAudience)) != audience.end());
  const double now = std::chrono::duration<double>(kNow.time_since_epoch()).count();
  return claims.value("iss", Json()) == kIssuer && is_for_us && until.is_number() && until.get<double>() > now &&
         claims.value("sub", Json()) == who.name && !who.name.empty();
}

void try_key_set(const std::string& text) {
  const auto keys = JsonWebTokens::parse(settings(), text);
  if (!keys) return expect(!keys.error().sentence.empty(), "a refusal has no sentence");
  for (const char* header : {R"({"alg":"none"})", R"({"alg":"HS256"})", R"({"alg":"ES256"})", R"({"alg":"RS256"})"})
    expect(!(*keys)->find(base64url(header) + "." + base64url(R"({"sub":"eve","exp":9e9})") + ".", kNow),
           "a token without a signature was taken");
}

void try_token(const std::string& token) {
  (void)issuer().lacks_key_of(token);
  expect(!issuer().find(token, kNow), "a token was taken that nobody has signed");
}

/// A header, a line feed and claims, which are signed; then a byte of the token is changed.
void try_signed(const std::string& text) {
  if (text.empty()) return;
  const std::size_t cut = text.find('\n');
  const std::string header = cut == text.npos ? R"({"alg":"ES256"})" : text.substr(1, cut == 0 ? 0 : cut - 1);
  const std::string claims = cut == text.npos ? text.substr(1) : text.substr(cut + 1);
  const std::string said = base64url(header) + "." + base64url(claims);
  std::string signature = signer().sign(said);
  const auto found = issuer().find(said + "." + base64url(signature), kNow);
  if (found) expect(may_enter(claims, *found), "a token was taken that says something else");
  const auto at = static_cast<unsigned char>(text[0]);
  signature[at % 64] = static_cast<char>(signature[at % 64] ^ (1 << (at / 64)));
  expect(!issuer().find(said + "." + base64url(signature), kNow), "a token with another signature was taken");
  if (found && claims.find("ann") != claims.npos) {
    std::string forged = claims;
    forged.replace(forged.find("ann"), 3, "eve");
    expect(!issuer().find(base64url(header) + "." + base64url(forged) + "." + base64url(signer().sign(said)), kNow),
           "a token with other claims was taken");
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  switch (data[0] % 4) {
    case 0:
      try_file(rest);
      break;
    case 1:
      try_key_set(rest);
      break;
    case 2:
      try_token(rest);
      break;
    default:
      try_signed(rest);
  }
  return 0;
}
