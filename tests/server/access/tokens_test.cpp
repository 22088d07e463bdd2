// Tokens, their file, and who is let in.
#include "server/access/tokens.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "core/base/sha256.h"
#include "server/access/access.h"

namespace varimesh::server::testing {
namespace {

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

constexpr WallTime kNow = std::chrono::sys_days(std::chrono::year(2026) / 11 / 23);

std::string line(const std::string& name, const std::string& roles, const std::string& token) {
  return name + " " + roles + " " + sha256(token) + "\n";
}

TEST(Tokens, SaysWhoseATokenIs) {
  const auto tokens =
      Tokens::parse("# who may call\n\n" + line("ann", "submit,read", "one") + line("ann", "read", "two") +
                    "  bob@example.org\tadmin " + sha256("three") + "  # the operator\n");
  ASSERT_TRUE(tokens) << tokens.error().sentence;
  EXPECT_EQ(tokens->size(), 3u);
  EXPECT_EQ(tokens->find("one", kNow)->name, "ann");
  EXPECT_EQ(tokens->find("one", kNow)->rights, kSubmit | kRead);
  EXPECT_EQ(tokens->find("two", kNow)->rights, kRead);
  EXPECT_EQ(tokens->find("three", kNow)->name, "bob@example.org");
  EXPECT_EQ(tokens->find("three", kNow)->rights, kAllRights) << "an admin may do everything";
  for (const std::string& wrong : {std::string("One"), std::string("one "), std::string("on"), std::string(),
                                   sha256("one"), std::string(5000, 'x'), std::string("one\0", 4)})
    EXPECT_FALSE(tokens->find(wrong, kNow)) << wrong;
}

TEST(Tokens, Expire) {
  const std::string digest = sha256("one");
  const auto at = [](int hour) { return kNow + std::chrono::hours(hour); };
  const auto by_day = Tokens::parse("ann read " + digest + " 2026-11-24");
  EXPECT_TRUE(by_day->find("one", at(23)));
  EXPECT_FALSE(by_day->find("one", at(24)));
  const auto by_hour = Tokens::parse("ann read " + digest + " 2026-11-23T12:30:00Z");
  EXPECT_TRUE(by_hour->find("one", at(12)));
  EXPECT_FALSE(by_hour->find("one", at(13)));
  EXPECT_FALSE(Tokens::parse("ann read " + digest + " 2024-02-29")->find("one", kNow)) << "long ago";
}

TEST(Tokens, RefusesWrongLinesWithoutQuotingThem) {
  const std::string digest = sha256("one");
  for (const std::string& wrong :
       {std::string("secret"), std::string("ann read secret"), "ann " + digest, "ann write " + digest,
        "ann read, " + digest + " secret", "a/b read " + digest, "ann read " + digest.substr(1),
        "ann read " + digest + " tomorrow", "ann read " + digest + " 2026-02-30",
        "ann read " + digest + " 2026-11-23T24:00:00Z", "ann read " + digest + " 2026-11-23T12:00:00",
        "ann read " + digest + " 2026-11-24 more", std::string(65, 'a') + " read " + digest,
        "ann read " + digest + "\nbob read " + digest}) {
    const auto tokens = Tokens::parse("# a comment\n" + wrong);
    ASSERT_FALSE(tokens) << wrong;
    EXPECT_TRUE(has(tokens.error().sentence, "Line ")) << wrong;
    EXPECT_FALSE(has(tokens.error().sentence, "secret")) << wrong;
    EXPECT_FALSE(has(tokens.error().sentence, digest.substr(1))) << wrong;
  }
}

TEST(Tokens, AreMadeAtRandom) {
  std::set<std::string> seen;
  for (int i = 0; i < 100; ++i) {
    const auto made = make_token("ann", {"submit", "cancel"}, "2027-01-31");
    ASSERT_TRUE(made);
    EXPECT_EQ(made->token.size(), 46u);
    EXPECT_TRUE(seen.insert(made->token).second);
    EXPECT_FALSE(has(made->line, made->token));
    const auto tokens = Tokens::parse(made->line);
    EXPECT_EQ(tokens->find(made->token, kNow)->rights, kSubmit | kCancel);
  }
  EXPECT_FALSE(make_token("a b", {"read"}, ""));
  EXPECT_FALSE(make_token("#", {"read"}, ""));
  EXPECT_FALSE(make_token("ann", {}, ""));
  EXPECT_FALSE(make_token("ann", {"write"}, ""));
  EXPECT_FALSE(make_token("ann", {"read"}, "soon"));
  EXPECT_FALSE(make_token("ann\nbob", {"read"}, ""));
}

TEST(Tokens, MayBeForAsGoodAsEver) {
  for (const std::string until : {"2262-04-12", "2427-01-31T12:00:00Z", "9999-12-31"}) {
    const auto made = make_token("ann", {"read"}, until);
    ASSERT_TRUE(made) << until;
    EXPECT_TRUE(Tokens::parse(made->line)->find(made->token, kNow)) << until;
  }
  EXPECT_LT(*time_of("1600-01-01"), kNow);
}

// ===== the file =====

class AccessByFile : public ::testing::Test {
 protected:
  AccessByFile() {
    std::string name = ::testing::TempDir() + "varimesh-tokens-XXXXXX";
    folder_ = ::mkdtemp(name.data());
    path_ = (folder_ / "tokens").string();
  }
  ~AccessByFile() override { std::filesystem::remove_all(folder_); }
  void write(const std::string& text) {
    std::ofstream(path_ + ".new") << text;
    std::filesystem::rename(path_ + ".new", path_);
  }
  static std::string admitted(const Access& access, const std::string& authorization, Method method = Method::GetJob) {
    const auto caller = access.admit(method, authorization, "10.0.0.7");
    return caller ? caller->owner : caller.error().reason;
  }

  std::filesystem::path folder_;
  std::string path_;
};

TEST_F(AccessByFile, LetsInWhoHasATokenAndTheRight) {
  write(line("ann", "read", "one") + line("bob", "submit", "two"));
  const auto access = Access::with_tokens(path_);
  ASSERT_TRUE(access) << access.error().sentence;
  EXPECT_TRUE((*access)->asks());
  EXPECT_EQ(admitted(**access, "Bearer one"), "ann");
  EXPECT_EQ(admitted(**access, "bearer one"), "ann") << "the scheme has no case";
  EXPECT_EQ(admitted(**access, ""), "TOKEN_MISSING");
  EXPECT_EQ(admitted(**access, "Bearer "), "TOKEN_MISSING");
  EXPECT_EQ(admitted(**access, "Basic one"), "TOKEN_MISSING");
  EXPECT_EQ(admitted(**access, "one"), "TOKEN_MISSING");
  EXPECT_EQ(admitted(**access, "Bearer three"), "TOKEN_UNKNOWN");
  EXPECT_EQ(admitted(**access, "Bearer two"), "RIGHT_MISSING");
  EXPECT_EQ(admitted(**access, "Bearer one", Method::SubmitJob), "RIGHT_MISSING");
  EXPECT_EQ(admitted(**access, "Bearer one", Method::GetServerInfo), "ann");
  EXPECT_EQ(admitted(**access, "Bearer two", Method::Optimise), "RIGHT_MISSING") << "it delivers the result";
  const auto refused = (*access)->admit(Method::CancelJob, "Bearer one", "10.0.0.7");
  EXPECT_EQ(refused.error().metadata.at("rights"), "cancel");
  EXPECT_EQ((*access)->admit(Method::GetJob, "Bearer one", "10.0.0.7")->peer, "ann") << "its limits go with the owner";
}

TEST_F(AccessByFile, AsksNobodyWithoutAFile) {
  const Access access;
  const auto caller = access.admit(Method::CancelJob, "Bearer anything", "10.0.0.7");
  ASSERT_TRUE(caller);
  EXPECT_EQ(caller->owner, "");
  EXPECT_EQ(caller->peer, "10.0.0.7");
  EXPECT_TRUE(caller->sees_all());
}

TEST_F(AccessByFile, KnowsTheNamesInCertificates) {
  const auto access = Access::with_certificates();
  EXPECT_TRUE(access->asks());
  const auto caller = access->admit(Method::CancelJob, "Bearer anything", "10.0.0.7", "ann");
  ASSERT_TRUE(caller);
  EXPECT_EQ(caller->owner, "ann");
  EXPECT_EQ(caller->peer, "ann");
  EXPECT_FALSE(caller->sees_all());
  EXPECT_EQ(access->admit(Method::GetJob, "", "10.0.0.7", "").error().reason, "CERTIFICATE_NAMELESS");
  EXPECT_EQ(access->admit(Method::LivePage, "", "127.0.0.1", "").error().reason, "RIGHT_MISSING");
}

TEST_F(AccessByFile, ReadsTheFileAgainWhenItChanges) {
  write(line("ann", "read", "one"));
  const auto access = std::move(*Access::with_tokens(path_));
  EXPECT_FALSE(*access->refresh());
  write(line("bob", "read", "two"));
  EXPECT_TRUE(*access->refresh());
  EXPECT_EQ(admitted(*access, "Bearer one"), "TOKEN_UNKNOWN");
  EXPECT_EQ(admitted(*access, "Bearer two"), "bob");
  write("nonsense");
  EXPECT_FALSE(access->refresh());
  EXPECT_TRUE(access->refresh()) << "it complains once";
  EXPECT_EQ(admitted(*access, "Bearer two"), "bob");
  std::filesystem::remove(path_);
  EXPECT_FALSE(access->refresh());
  EXPECT_TRUE(access->refresh());
  EXPECT_EQ(admitted(*access, "Bearer two"), "bob");
  write("# nobody\n");
  EXPECT_TRUE(*access->refresh());
  EXPECT_EQ(admitted(*access, "Bearer two"), "TOKEN_UNKNOWN") << "an empty file lets nobody in";
}

TEST_F(AccessByFile, RefusesAFileThatOthersCouldHaveWritten) {
  EXPECT_FALSE(Access::with_tokens(path_)) << "there is none";
  EXPECT_FALSE(Access::with_tokens(folder_.string())) << "it is a folder";
  write(line("ann", "read", "one"));
  for (const mode_t mode : {0620, 0602, 0666}) {
    ASSERT_EQ(::chmod(path_.c_str(), mode), 0);
    const auto access = Access::with_tokens(path_);
    ASSERT_FALSE(access) << mode;
    EXPECT_TRUE(has(access.error().sentence, "chmod go-w"));
  }
  ASSERT_EQ(::chmod(path_.c_str(), 0644), 0);
  EXPECT_TRUE(Access::with_tokens(path_));
}

}  // namespace
}  // namespace varimesh::server::testing
