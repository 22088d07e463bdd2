#include "server/webhooks/receivers.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace varimesh::server {
namespace {

const std::string kKey = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";

std::string origin(std::string_view url) { return origin_of(url).value_or("none"); }

TEST(Receivers, AreFoundByTheBeginningOfAnAddress) {
  const auto receivers = Receivers::parse("# of the build\nhttps://CI.example.org " + kKey +
                                          "  # a comment\n\nhttp://10.0.0.5:8080 " + kKey + " private\n");
  ASSERT_TRUE(receivers) << receivers.error().sentence;
  EXPECT_EQ(receivers->size(), 2U);
  for (const char* const url : {"https://ci.example.org", "https://ci.example.org/jobs?token=1#x",
                                "HTTPS://ci.EXAMPLE.org:443/a", "https://ci.example.org?a"})
    EXPECT_NE(receivers->find(url), nullptr) << url;
  EXPECT_FALSE(receivers->find("https://ci.example.org/")->may_be_private);
  EXPECT_TRUE(receivers->find("http://10.0.0.5:8080/a")->may_be_private);
  EXPECT_EQ(receivers->find("https://ci.example.org/")->key.size(), 24U);
  for (const char* const url : {"http://ci.example.org/",
                                "https://ci.example.org:8443/",
                                "https://ci.example.org.evil.example/",
                                "https://evil.example/https://ci.example.org",
                                "https://ci.example.org@evil.example/",
                                "https://ci.example.org:443@evil.example/",
                                "https://evil.example#@ci.example.org/",
                                "https://ci.example.org\\@evil.example/",
                                "https://ci.example.org%2eevil.example/",
                                "https://ci.example.org.",
                                "https://ci.example.org:0443x/",
                                "https://ci.example.org :443/",
                                "https:ci.example.org/",
                                "//ci.example.org/",
                                "ci.example.org",
                                "ftp://ci.example.org/",
                                "file:///etc/passwd",
                                "https://",
                                "https:///ci.example.org",
                                "http://10.0.0.5/",
                                "http://10.0.0.5:8081/",
                                "http://0xa.0.0.5:8080/",
                                "http://167772165:8080/",
                                "https://ci.example.org\r\nX: y",
                                "https://ci.example.org/\xc3\xa4",
                                ""})
    EXPECT_EQ(receivers->find(url), nullptr) << url;
  EXPECT_EQ(receivers->find("https://ci.example.org/" + std::string(2048, 'a')), nullptr);
}

TEST(Receivers, HaveOrigins) {
  EXPECT_EQ(origin("https://a.example:443/b"), "https://a.example");
  EXPECT_EQ(origin("http://a.example:80"), "http://a.example");
  EXPECT_EQ(origin("http://a.example:443"), "http://a.example:443");
  EXPECT_EQ(origin("https://[2001:DB8::1]:8443/x"), "https://[2001:db8::1]:8443");
  EXPECT_EQ(origin("https://[::1]"), "https://[::1]");
  EXPECT_EQ(origin("https://[fe80::1%25eth0]/"), "none");
  EXPECT_EQ(origin("https://a.example:0/"), "none");
  EXPECT_EQ(origin("https://a.example:65536/"), "none");
  EXPECT_EQ(origin("https://a.example:/"), "none");
}

TEST(Receivers, OfAWrongLineAreRefusedWithItsNumber) {
  for (const std::string& line : std::vector<std::string>{
           "https://ci.example.org", "https://ci.example.org secret", "https://ci.example.org whsec_c2hvcnQ=",
           "https://ci.example.org whsec_****", "https://ci.example.org " + kKey + " public",
           "https://ci.example.org " + kKey + " private more", "https://ci.example.org/path " + kKey,
           "ci.example.org " + kKey, "http://ci.example.org " + kKey, "https://*.example.org " + kKey}) {
    const auto receivers = Receivers::parse("\n" + line + "\n");
    ASSERT_FALSE(receivers) << line;
    EXPECT_EQ(receivers.error().sentence.rfind("Line 2 of the file of --webhooks ", 0), 0U)
        << receivers.error().sentence;
    EXPECT_EQ(receivers.error().sentence.find("MfKQ"), std::string::npos) << "the key is secret";
  }
  EXPECT_FALSE(Receivers::parse("https://a.example " + kKey + "\nhttps://A.example:443 " + kKey));
}

TEST(Receivers, AreCheckedBeforeAJobIsTaken) {
  const auto receivers = Receivers::parse("https://ci.example.org " + kKey);
  EXPECT_TRUE(check_webhook("https://ci.example.org/jobs", &*receivers));
  EXPECT_EQ(check_webhook("https://evil.example/jobs", &*receivers).error().reason, "BAD_OPTION");
  EXPECT_EQ(check_webhook("evil", &*receivers).error().reason, "BAD_OPTION");
  EXPECT_EQ(check_webhook("https://ci.example.org/jobs", nullptr).error().reason, "BAD_OPTION");
}

// The example of the libraries of https://github.com/standard-webhooks/standard-webhooks.
TEST(Receivers, GetTheSignatureOfStandardWebhooks) {
  const auto receivers = Receivers::parse("https://ci.example.org " + kKey);
  EXPECT_EQ(webhook_signature(receivers->find("https://ci.example.org")->key, "msg_p5jXN8AQM9LWM0D4loKWxJek",
                              "1614265330", R"({"test": 2432232314})"),
            "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
}

}  // namespace
}  // namespace varimesh::server
