// Which JSON Web Tokens let somebody in. The keys are made for each run; libjwt signs the tokens.
#include "server/access/json_web_tokens.h"

#include <gtest/gtest.h>

#ifdef VARIMESH_LIBJWT
#include <jwt.h>
#include <openssl/bn.h>
#include <openssl/core_names.h>
#include <openssl/evp.h>
#include <openssl/pem.h>

#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "server/access/access.h"
#include "tests/server/access/base64url.h"
#endif

namespace varimesh::server::testing {
namespace {

#ifndef VARIMESH_LIBJWT

TEST(JsonWebTokens, AreNotKnownToThisBuild) {
  EXPECT_FALSE(JsonWebTokens::available());
  EXPECT_FALSE(JsonWebTokens::parse({"keys", "issuer", "audience"}, "{}"));
}

#else

using Json = nlohmann::json;

const WallTime kNow = std::chrono::floor<std::chrono::seconds>(std::chrono::system_clock::now());

std::int64_t seconds(WallTime time) {
  return std::chrono::duration_cast<std::chrono::seconds>(time.time_since_epoch()).count();
}

/// A key pair, its private half in PEM, and its public half as a JSON Web Key.
struct TestKey {
  explicit TestKey(EVP_PKEY* made, const std::string& id) : key(made) {
    BIO* memory = BIO_new(BIO_s_mem());
    PEM_write_bio_PrivateKey(memory, key, nullptr, nullptr, 0, nullptr, nullptr);
    char* data = nullptr;
    const long size = BIO_get_mem_data(memory, &data);
    pem.assign(data, static_cast<std::size_t>(size));
    BIO_free_all(memory);
    web["kid"] = id;
    web["use"] = "sig";
    if (EVP_PKEY_is_a(key, "RSA") == 1) {
      web["kty"] = "RSA";
      web["n"] = number(OSSL_PKEY_PARAM_RSA_N, 0);
      web["e"] = number(OSSL_PKEY_PARAM_RSA_E, 0);
    } else {
      web["kty"] = "EC";
      web["crv"] = "P-256";
      web["x"] = number(OSSL_PKEY_PARAM_EC_PUB_X, 32);
      web["y"] = number(OSSL_PKEY_PARAM_EC_PUB_Y, 32);
    }
  }
  ~TestKey() { EVP_PKEY_free(key); }
  TestKey(const TestKey&) = delete;
  TestKey& operator=(const TestKey&) = delete;

  std::string number(const char* name, int bytes) const {
    BIGNUM* value = nullptr;
    EXPECT_EQ(EVP_PKEY_get_bn_param(key, name, &value), 1);
    std::string text(static_cast<std::size_t>(bytes > 0 ? bytes : BN_num_bytes(value)), '\0');
    BN_bn2binpad(value, reinterpret_cast<unsigned char*>(text.data()), static_cast<int>(text.size()));
    BN_free(value);
    return base64url(text);
  }

  EVP_PKEY* key;
  std::string pem;
  Json web;
};

class JsonWebTokensTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    rsa_ = new TestKey(EVP_RSA_gen(2048), "rsa");
    ec_ = new TestKey(EVP_EC_gen("P-256"), "ec");
    other_ = new TestKey(EVP_RSA_gen(2048), "rsa");
    small_ = new TestKey(EVP_RSA_gen(1024), "small");
  }
  static void TearDownTestSuite() {
    for (const TestKey* key : {rsa_, ec_, other_, small_}) delete key;
  }

  static JsonWebTokenSettings settings() { return {"keys.json", "https://issuer.example", "varimesh"}; }
  static std::string key_set(const std::vector<const TestKey*>& keys) {
    Json set;
    set["keys"] = Json::array();
    for (const TestKey* key : keys) set["keys"].push_back(key->web);
    return set.dump();
  }
  static Json claims() {
    return {{"iss", "https://issuer.example"},
            {"aud", "varimesh"},
            {"sub", "ann"},
            {"exp", seconds(kNow) + 600},
            {"roles", {"submit", "read"}}};
  }
  static std::string sign(const Json& claims, jwt_alg_t algorithm, const std::string& key, const std::string& id = "",
                          const Json& more = {}) {
    jwt_t* token = nullptr;
    EXPECT_EQ(jwt_new(&token), 0);
    EXPECT_EQ(jwt_add_grants_json(token, claims.dump().c_str()), 0);
    EXPECT_EQ(
        jwt_set_alg(token, algorithm, reinterpret_cast<const unsigned char*>(key.data()), static_cast<int>(key.size())),
        0);
    if (!id.empty()) jwt_add_header(token, "kid", id.c_str());
    if (!more.is_null()) jwt_add_headers_json(token, more.dump().c_str());
    char* const text = jwt_encode_str(token);
    std::string result = text == nullptr ? "" : text;
    std::free(text);
    jwt_free(token);
    EXPECT_FALSE(result.empty());
    return result;
  }
  static std::string signed_by_rsa(const Json& claims) { return sign(claims, JWT_ALG_RS256, rsa_->pem, "rsa"); }
  /// A token with these claims but without one of them, or with another value of it.
  static std::string with(const std::string& claim, const Json& value) {
    Json changed = claims();
    if (value.is_null())
      changed.erase(claim);
    else
      changed[claim] = value;
    return signed_by_rsa(changed);
  }

  static inline const TestKey *rsa_, *ec_, *other_, *small_;
  const std::shared_ptr<const JsonWebTokens> tokens_ = *JsonWebTokens::parse(settings(), key_set({rsa_, ec_}));
};

TEST_F(JsonWebTokensTest, OfTheIssuerLetTheirOwnersIn) {
  for (const std::string& token : {signed_by_rsa(claims()), sign(claims(), JWT_ALG_ES256, ec_->pem, "ec"),
                                   sign(claims(), JWT_ALG_ES256, ec_->pem), with("aud", {"other", "varimesh"}),
                                   with("nbf", seconds(kNow) + 30), with("roles", "read submit varimesh-user")}) {
    const auto principal = tokens_->find(token, kNow);
    ASSERT_TRUE(principal) << token;
    EXPECT_EQ(principal->name, "ann");
    EXPECT_EQ(principal->rights, kSubmit | kRead);
  }
  EXPECT_EQ(tokens_->find(with("roles", nullptr), kNow)->rights, kNoRight);
  EXPECT_EQ(tokens_->find(with("roles", {"Admin", 7, "admin "}), kNow)->rights, kNoRight);
  EXPECT_EQ(tokens_->find(with("roles", {"admin"}), kNow)->rights, kAllRights);
}

TEST_F(JsonWebTokensTest, WithWrongClaimsAreRefused) {
  for (const auto& [claim, value] : std::vector<std::pair<std::string, Json>>{{"iss", nullptr},
                                                                              {"iss", "https://issuer.example/"},
                                                                              {"aud", nullptr},
                                                                              {"aud", "varimesh2"},
                                                                              {"aud", Json::array()},
                                                                              {"aud", {"other"}},
                                                                              {"exp", nullptr},
                                                                              {"exp", seconds(kNow)},
                                                                              {"exp", "tomorrow"},
                                                                              {"exp", -1},
                                                                              {"nbf", seconds(kNow) + 120},
                                                                              {"nbf", "yesterday"},
                                                                              {"sub", nullptr},
                                                                              {"sub", ""},
                                                                              {"sub", "a b"},
                                                                              {"sub", "a\nb"},
                                                                              {"sub", 7},
                                                                              {"sub", std::string(129, 'a')}})
    EXPECT_FALSE(tokens_->find(with(claim, value), kNow)) << claim << " " << value;
  EXPECT_FALSE(tokens_->find(signed_by_rsa(claims()), kNow + std::chrono::hours(1))) << "it has expired";
}

TEST_F(JsonWebTokensTest, WithOtherSignaturesAreRefused) {
  const std::string right = signed_by_rsa(claims());
  const auto dot = right.find('.'), last = right.rfind('.');
  const std::string none = base64url(R"({"alg":"none"})"), payload = right.substr(dot, last - dot);
  // The public key as the secret of an HMAC: the well-known confusion of algorithms.
  BIO* memory = BIO_new(BIO_s_mem());
  PEM_write_bio_PUBKEY(memory, rsa_->key);
  char* data = nullptr;
  const long size = BIO_get_mem_data(memory, &data);
  const std::string public_pem(data, static_cast<std::size_t>(size));
  BIO_free_all(memory);
  std::string flipped = right;
  flipped[dot + 5] = flipped[dot + 5] == 'A' ? 'B' : 'A';
  for (const std::string& wrong :
       {none + payload + ".", none + payload + right.substr(last), sign(claims(), JWT_ALG_HS256, public_pem, "rsa"),
        sign(claims(), JWT_ALG_RS512, rsa_->pem, "rsa"), sign(claims(), JWT_ALG_RS256, other_->pem, "rsa"),
        sign(claims(), JWT_ALG_RS256, rsa_->pem, "ec"), sign(claims(), JWT_ALG_ES256, ec_->pem, "rsa"),
        sign(claims(), JWT_ALG_RS256, rsa_->pem, "rsa", {{"crit", {"b64"}}}), right.substr(0, last),
        right.substr(0, last + 1), right + ".", right + "A", right.substr(1), flipped, std::string(20'000, 'A'),
        std::string(".."), std::string(), right + std::string("\0", 1)})
    EXPECT_FALSE(tokens_->find(wrong, kNow)) << wrong;
  EXPECT_TRUE(tokens_->find(right, kNow));
}

TEST_F(JsonWebTokensTest, KeySetsThatCannotBeUsedAreRefused) {
  for (const std::string& set : {std::string(), std::string("[]"), std::string("{}"), std::string("{\"keys\": 7}"),
                                 std::string("{\"keys\": [7, {}, {\"kty\": \"RSA\"}]}"), key_set({small_}),
                                 std::string(R"({"keys": [{"kty": "oct", "k": "c2VjcmV0"}]})")})
    EXPECT_FALSE(JsonWebTokens::parse(settings(), set)) << set;
  Json for_secrets = rsa_->web, of_another_algorithm = rsa_->web;
  for_secrets["use"] = "enc";
  of_another_algorithm["alg"] = "RS512";
  for (const Json& key : {for_secrets, of_another_algorithm})
    EXPECT_FALSE(JsonWebTokens::parse(settings(), Json{{"keys", {key}}}.dump())) << key;
  EXPECT_TRUE(JsonWebTokens::parse(settings(), key_set({small_, ec_}))) << "others are left out";
  EXPECT_FALSE(JsonWebTokens::parse({"keys.json", "", "varimesh"}, key_set({rsa_})));
  EXPECT_FALSE(JsonWebTokens::parse({"keys.json", "https://issuer.example", ""}, key_set({rsa_})));
}

TEST_F(JsonWebTokensTest, OpenTheDoorOfAServerAndTheirKeysAreReadAgain) {
  std::string folder = ::testing::TempDir() + "varimesh-keys-XXXXXX";
  ASSERT_NE(::mkdtemp(folder.data()), nullptr);
  JsonWebTokenSettings used = settings();
  used.keys = folder + "/keys.json";
  const auto write = [&](const std::string& text) {
    std::ofstream(used.keys + ".new") << text;
    std::filesystem::rename(used.keys + ".new", used.keys);
  };
  write(key_set({rsa_}));
  const auto opened = Access::with_tokens("", used, [] { return kNow; });
  ASSERT_TRUE(opened) << opened.error().sentence;
  Access& access = **opened;
  EXPECT_TRUE(access.asks());
  const auto owner_of = [&](const std::string& token) {
    const auto caller = access.admit(Method::GetJob, "Bearer " + token, "10.0.0.7");
    return caller ? caller->owner : caller.error().reason;
  };
  const std::string old = signed_by_rsa(claims()), fresh = sign(claims(), JWT_ALG_RS256, other_->pem, "rsa");
  EXPECT_EQ(owner_of(old), "ann");
  EXPECT_EQ(owner_of(fresh), "TOKEN_UNKNOWN");
  EXPECT_EQ(access.admit(Method::CancelJob, "Bearer " + old, "10.0.0.7").error().reason, "RIGHT_MISSING");
  EXPECT_EQ(access.admit(Method::GetJob, "", "10.0.0.7").error().reason, "TOKEN_MISSING");
  EXPECT_FALSE(*access.refresh());
  write(key_set({other_}));
  EXPECT_TRUE(*access.refresh());
  EXPECT_EQ(owner_of(old), "TOKEN_UNKNOWN") << "the issuer has taken its key back";
  EXPECT_EQ(owner_of(fresh), "ann");
  write("nonsense");
  EXPECT_FALSE(access.refresh());
  EXPECT_EQ(owner_of(fresh), "ann") << "a file that cannot be used changes nothing";
  std::filesystem::remove_all(folder);
}

/// An issuer whose keys are fetched. A test sets what its server answers, and the time.
class FetchedKeys : public JsonWebTokensTest {
 protected:
  JsonWebTokenSettings fetched(const std::string& keys) {
    JsonWebTokenSettings used = settings();
    used.keys = keys;
    used.authority = "authority.pem";
    used.fetch = [this](const std::string& url, const std::string& authority) -> Expected<std::string> {
      EXPECT_EQ(authority, "authority.pem");
      asked_.push_back(url);
      const auto found = answers_.find(url);
      if (found == answers_.end()) return tl::unexpected(Error{Error::Kind::Output, "There is no answer."});
      return found->second;
    };
    return used;
  }

  const std::string url_ = "https://issuer.example/keys";
  std::map<std::string, std::string> answers_;
  std::vector<std::string> asked_;
  IssuerKeys::Time now_{std::chrono::hours(1000)};
};

TEST_F(FetchedKeys, AreFetchedEveryHourAndForAKeyThatNobodyKnows) {
  answers_[url_] = key_set({rsa_});
  IssuerKeys keys(fetched(url_), [this] { return now_; });
  EXPECT_EQ(keys.current(), nullptr);
  EXPECT_TRUE(keys.ask_for(signed_by_rsa(claims()))) << "there are no keys yet";
  EXPECT_FALSE(keys.ask_for("vm_token")) << "that is no token of an issuer";
  EXPECT_TRUE(*keys.refresh());
  EXPECT_FALSE(*keys.refresh());
  EXPECT_TRUE(keys.current()->find(signed_by_rsa(claims()), kNow));

  const std::string fresh = sign(claims(), JWT_ALG_ES256, ec_->pem, "ec");
  EXPECT_FALSE(keys.ask_for(signed_by_rsa(claims()))) << "its key is known";
  EXPECT_FALSE(keys.ask_for(fresh)) << "the keys are not a minute old";
  now_ += std::chrono::minutes(1);
  answers_[url_] = key_set({rsa_, ec_});
  EXPECT_TRUE(keys.ask_for(fresh));
  EXPECT_TRUE(*keys.refresh());
  EXPECT_TRUE(keys.current()->find(fresh, kNow));
  for (int i = 0; i < 100; ++i) keys.ask_for(sign(claims(), JWT_ALG_ES256, ec_->pem, std::to_string(i)));
  EXPECT_FALSE(*keys.refresh()) << "whoever makes up names of keys makes the server ask no more often";
  EXPECT_EQ(asked_.size(), 2U);

  answers_.clear();
  now_ += std::chrono::hours(1);
  EXPECT_FALSE(keys.refresh());
  EXPECT_TRUE(keys.current()->find(fresh, kNow)) << "the old keys stay";
  EXPECT_TRUE(keys.refresh()) << "it is not tried again at once";
  now_ += std::chrono::seconds(30);
  EXPECT_FALSE(keys.refresh());
  now_ += std::chrono::hours(24);
  EXPECT_EQ(keys.current(), nullptr) << "keys that the issuer may have taken back long ago";
}

TEST_F(FetchedKeys, AreWhereTheConfigurationOfTheIssuerSays) {
  const std::string configuration = "https://issuer.example/.well-known/openid-configuration";
  answers_[url_] = key_set({rsa_});
  IssuerKeys keys(fetched(""), [this] { return now_; });
  for (const char* wrong :
       {"nonsense", "{}", R"({"issuer": "https://other.example", "jwks_uri": "https://issuer.example/keys"})",
        R"({"issuer": "https://issuer.example", "jwks_uri": "http://issuer.example/keys"})",
        R"({"issuer": "https://issuer.example", "jwks_uri": 7})"}) {
    answers_[configuration] = wrong;
    EXPECT_FALSE(keys.refresh()) << wrong;
    now_ += std::chrono::minutes(1);
  }
  EXPECT_EQ(asked_, std::vector<std::string>(5, configuration));
  answers_[configuration] = R"({"issuer": "https://issuer.example", "jwks_uri": "https://issuer.example/keys"})";
  EXPECT_TRUE(*keys.refresh());
  EXPECT_TRUE(keys.current()->find(signed_by_rsa(claims()), kNow));
}

TEST_F(FetchedKeys, KeepTheDoorShutUntilTheyAreThere) {
  const auto opened = Access::with_tokens("", fetched(url_), [] { return kNow; });
  ASSERT_TRUE(opened) << opened.error().sentence;
  Access& access = **opened;
  EXPECT_TRUE(access.asks());
  const auto reason_of = [&](const std::string& authorization) {
    const auto caller = access.admit(Method::GetJob, authorization, "10.0.0.7");
    return caller ? caller->owner : caller.error().reason;
  };
  EXPECT_EQ(reason_of(""), "TOKEN_MISSING");
  EXPECT_EQ(reason_of("Bearer nonsense"), "TOKEN_UNKNOWN");
  EXPECT_EQ(reason_of("Bearer " + signed_by_rsa(claims())), "KEYS_UNAVAILABLE");
  EXPECT_FALSE(access.fetch_keys()) << "why the first attempt failed";
  EXPECT_FALSE(*access.fetch_keys()) << "it is not tried again at once";
  answers_[url_] = key_set({rsa_});
  const auto later = Access::with_tokens("", fetched(url_), [] { return kNow; });
  EXPECT_EQ((*later)->admit(Method::GetJob, "Bearer " + signed_by_rsa(claims()), "10.0.0.7")->owner, "ann");
  const std::string other = sign(claims(), JWT_ALG_RS256, other_->pem, "rsa");
  EXPECT_EQ((*later)->admit(Method::GetJob, "Bearer " + other, "10.0.0.7").error().reason, "TOKEN_UNKNOWN");
  EXPECT_FALSE(Access::with_tokens("", settings(), [] { return kNow; })) << "there is no such file";
  JsonWebTokenSettings without = fetched(url_);
  without.fetch = nullptr;
  EXPECT_FALSE(Access::with_tokens("", without, [] { return kNow; })) << "a build without libcurl";
}

#endif

}  // namespace
}  // namespace varimesh::server::testing
