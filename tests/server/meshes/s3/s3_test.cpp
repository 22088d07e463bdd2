// Meshes in a bucket of a real S3 server, through a proxy that fails.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "server/meshes/s3/bucket.h"
#include "server/meshes/s3/xml.h"
#include "tests/server/meshes/s3/buckets.h"
#include "tests/server/meshes/s3/fault_proxy.h"

namespace varimesh::server::testing {
namespace {

using std::chrono::milliseconds;

INSTANTIATE_TEST_SUITE_P(Bucket, SharedStoreConformance,
                         ::testing::Values([] { return std::make_unique<InBucket>(); }));

/// Bytes that do not repeat, so that parts in the wrong order differ.
std::string many_bytes(std::size_t size) {
  std::string bytes;
  for (std::size_t i = 0; bytes.size() < size; ++i) bytes += std::to_string(i) + ' ';
  bytes.resize(size);
  return bytes;
}

class MeshesInABucket : public ::testing::Test {
 protected:
  MeshesInABucket() { store_ = open(); }
  void TearDown() override { EXPECT_EQ(proxy_.wrong_signatures(), expected_wrong_signatures_); }
  std::unique_ptr<MeshStore> open() {
    DirectoryMeshSettings settings = settings_with();
    settings.max_mesh_bytes = 1 << 30;
    return place_.open(settings, [](const Digests&) { return Digests(); });
  }
  /// Uploads in chunks as a client does, and returns the answer: the digest, or the reason of a refusal.
  static std::string send(MeshStore& store, const std::string& bytes) {
    const auto ticket = store.begin_upload("id", sha256(bytes), static_cast<std::int64_t>(bytes.size()));
    if (!ticket) return ticket.error().reason;
    constexpr std::size_t kChunk = 256 * 1024;
    for (std::size_t at = static_cast<std::size_t>(ticket->committed); at < bytes.size(); at += kChunk) {
      const auto sent = store.append(*ticket, static_cast<std::int64_t>(at), bytes.substr(at, kChunk));
      if (!sent) return sent.error().reason;
    }
    const auto stored = store.finish_upload(*ticket);
    return stored ? stored->digest : stored.error().reason;
  }

  FaultProxy proxy_{bucket_server().port};
  InBucket place_{proxy_.port()};
  int expected_wrong_signatures_ = 0;
  std::unique_ptr<MeshStore> store_;
};

TEST_F(MeshesInABucket, AreStoredInPartsIfTheyAreLarge) {
  const std::string bytes = many_bytes(20'000'001);
  EXPECT_EQ(send(*store_, bytes), sha256(bytes));
  const auto objects = place_.direct()->list("meshes/", place_.patience);
  ASSERT_TRUE(objects) << objects.error().sentence;
  const auto copy = std::ranges::find_if(*objects, [](const auto& object) { return object.size == 20'000'001; });
  ASSERT_NE(copy, objects->end());
  EXPECT_EQ(proxy_.parts(), 3);
  EXPECT_TRUE(place_.direct()->list("uploads/", place_.patience)->empty());
  EXPECT_EQ(read_whole(*open(), sha256(bytes)), bytes);
  EXPECT_EQ(write(*store_, bytes + "!").digest, sha256(bytes + "!")) << "a result";
  EXPECT_EQ(read_whole(*open(), sha256(bytes + "!")), bytes + "!");
}

TEST_F(MeshesInABucket, AreUploadedThroughAnotherServerAfterOneWasLost) {
  const std::string bytes = many_bytes(30'000'000);
  {
    const auto ticket = store_->begin_upload("id", sha256(bytes), 30'000'000);
    ASSERT_TRUE(ticket) << ticket.error().sentence;
    for (std::size_t at = 0; at < 20'000'000; at += 500'000)
      ASSERT_TRUE(store_->append(*ticket, static_cast<std::int64_t>(at), bytes.substr(at, 500'000)));
    const auto other = open();  // the first one has said nothing of its end
    const std::int64_t committed = other->query_upload("id", sha256(bytes))->committed;
    EXPECT_GE(committed, 2 * S3Client::kPieceBytes);
    EXPECT_LE(committed, 20'000'000);
    EXPECT_EQ(send(*other, bytes), sha256(bytes));
  }
  EXPECT_EQ(read_whole(*open(), sha256(bytes)), bytes);
}

TEST_F(MeshesInABucket, AreWholeWhenTheServerIsBusy) {
  const std::string bytes = many_bytes(10'000'000);
  proxy_.refuse(9);
  EXPECT_EQ(send(*store_, bytes), sha256(bytes));
  proxy_.refuse(9);
  EXPECT_EQ(read_whole(*open(), sha256(bytes)), bytes);
  EXPECT_EQ(proxy_.faults(), 18);
}

TEST_F(MeshesInABucket, AreWholeWhenBodiesAreCut) {
  const std::string bytes = many_bytes(20'000'000);
  proxy_.cut_requests(3, 3'000'000);
  EXPECT_EQ(send(*store_, bytes), sha256(bytes));
  EXPECT_EQ(proxy_.faults(), 3);
  proxy_.cut_answers(3, 5'000'000);
  EXPECT_EQ(read_whole(*open(), sha256(bytes)), bytes);
  EXPECT_EQ(proxy_.faults(), 6);
}

TEST_F(MeshesInABucket, AreFetchedAgainWhenABitChangesOnTheWay) {
  const std::string bytes = many_bytes(9'000'000), digest = sha256(bytes);
  EXPECT_EQ(send(*store_, bytes), digest);
  proxy_.flip_bits(1);
  EXPECT_EQ(read_whole(*open(), digest), bytes);
  EXPECT_EQ(proxy_.faults(), 1);
  EXPECT_TRUE(place_.has(digest)) << "its only copy is not deleted for that";
}

TEST_F(MeshesInABucket, AreMovedAsideWhenTheyAreDamaged) {
  const std::string digest = send(*store_, "a mesh");
  place_.damage(digest);
  EXPECT_EQ(open()->open(digest).error().code, Failure::Code::DataLoss);
  EXPECT_FALSE(place_.has(digest));
  const auto aside = place_.direct()->list("damaged/" + digest, place_.patience);
  ASSERT_EQ(aside->size(), 1U);
  EXPECT_EQ(*place_.direct()->get_small(aside->front().key, place_.patience), "x mesh");
}

TEST_F(MeshesInABucket, AreWholeWhenAnyAnswerIsLost) {
  // The server has done what the request asked, and nobody knows.
  const std::string bytes = many_bytes(9'000'000);
  for (int before = 0; before < 16; ++before) {
    const auto store = open();
    std::atomic<bool> done = false;
    std::thread losing([&] {
      std::this_thread::sleep_for(milliseconds(5 * before));
      proxy_.lose_answers(1);
    });
    const std::string mesh = bytes + std::to_string(before);
    EXPECT_EQ(write(*store, mesh).digest, sha256(mesh));
    losing.join();
    EXPECT_EQ(read_whole(*open(), sha256(mesh)), mesh);
  }
  EXPECT_GT(proxy_.faults(), 8);
}

TEST_F(MeshesInABucket, AreStoredByAServerThatStalls) {
  place_.stalled = std::chrono::seconds(2);
  const auto store = open();
  proxy_.stall(2, 4'000);  // longer than the client waits for a sign of life
  EXPECT_EQ(send(*store, "a mesh"), sha256("a mesh"));
  EXPECT_GE(proxy_.faults(), 1);
}

TEST_F(MeshesInABucket, WaitForAServerThatComesBack) {
  const std::string digest = send(*store_, "a mesh");
  proxy_.go_away(true);
  std::thread back([&] {
    std::this_thread::sleep_for(milliseconds(3'000));
    proxy_.go_away(false);
  });
  EXPECT_EQ(write(*store_, "a result").digest, sha256("a result"));
  back.join();
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_EQ(read_whole(*open(), digest), "a mesh");
  EXPECT_LT(std::chrono::steady_clock::now() - begun, milliseconds(5'000));
}

TEST_F(MeshesInABucket, AreRefusedWhenTheServerIsAway) {
  const std::string digest = send(*store_, "a mesh");
  place_.patience = milliseconds(1'500);
  const auto store = open();
  ASSERT_TRUE(store->open(digest));
  proxy_.go_away(true);
  EXPECT_EQ(send(*store, "another"), "STORE_UNAVAILABLE");
  EXPECT_EQ(store->size_of(digest).error().reason, "STORE_UNAVAILABLE");
  EXPECT_FALSE(store->touch(digest));
  EXPECT_EQ(read_whole(*store, digest), "a mesh") << "its copy on this server's disk";
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_EQ(store->size_of(digest).error().reason, "STORE_UNAVAILABLE");
  EXPECT_LT(std::chrono::steady_clock::now() - begun, milliseconds(1'000)) << "calls do not pile up";
}

TEST_F(MeshesInABucket, HaveCopiesOnTheDiskUpToALimit) {
  place_.max_cache_bytes = 2'500;
  const auto store = open();
  std::vector<std::string> digests;
  for (const char letter : {'a', 'b', 'c', 'd'}) digests.push_back(send(*store, std::string(1'000, letter)));
  const std::filesystem::path folder = std::filesystem::path(place_.new_directory()).parent_path();
  std::uintmax_t bytes = 0;
  int copies = 0;
  for (const auto& file : std::filesystem::recursive_directory_iterator(folder))
    if (file.is_regular_file()) bytes += file.file_size(), ++copies;
  EXPECT_EQ(copies, 2);
  EXPECT_LE(bytes, 2'500U);
  for (const std::string& digest : digests) EXPECT_EQ(sha256(read_whole(*store, digest)), digest);
  for (const auto& file : std::filesystem::recursive_directory_iterator(folder))
    if (file.is_regular_file()) std::ofstream(file.path()) << "damaged";
  for (const std::string& digest : digests)
    EXPECT_EQ(sha256(read_whole(*store, digest)), digest) << "a copy that is damaged is fetched again";
}

TEST_F(MeshesInABucket, NeedTheRightKey) {
  const auto client = place_.client("wrong");
  const auto refused = client->put("key", "bytes", place_.patience);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Failure::Code::Internal);
  EXPECT_NE(refused.error().sentence.find("SignatureDoesNotMatch"), std::string::npos) << refused.error().sentence;
  EXPECT_EQ(refused.error().sentence.find("wrong"), std::string::npos);
  expected_wrong_signatures_ = 1;
}

TEST_F(MeshesInABucket, UseAKeyThatIsRenewed) {
  S3Settings settings;
  settings.address =
      *parse_s3_address("s3://varimesh/renewed?endpoint=http://127.0.0.1:" + std::to_string(proxy_.port()));
  int reads = 0;
  settings.credentials = [&]() -> Expected<S3Credentials> {
    return S3Credentials{bucket_server().key_id, ++reads == 1 ? "old" : "S3RVER", ""};
  };
  S3Client client(settings);
  EXPECT_TRUE(client.put("key", "bytes", place_.patience));
  EXPECT_EQ(reads, 2);
  expected_wrong_signatures_ = 1;
}

TEST_F(MeshesInABucket, AreListedInPages) {
  const auto client = place_.client();
  for (int i = 0; i < 1'005; ++i) ASSERT_TRUE(client->put("many/" + std::to_string(i), "x", place_.patience));
  const auto all = client->list("many/", place_.patience);
  ASSERT_TRUE(all) << all.error().sentence;
  EXPECT_EQ(all->size(), 1'005U);
}

// ===== the address =====

TEST(BucketList, EndsIfTheServerRepeatsItself) {
  for (const std::size_t period : {1U, 2U, 3U}) {
    std::size_t pages = 0;
    const auto list = all_pages([&](const std::string&) -> Answer<S3Page> {
      EXPECT_LT(++pages, 100u);
      return S3Page{std::vector<S3Object>(1000), "page " + std::to_string(pages % period)};
    });
    ASSERT_FALSE(list);
    EXPECT_NE(list.error().sentence.find("repeats a page"), std::string::npos) << list.error().sentence;
    EXPECT_LE(pages, period + 1);
  }
  int page = 0;
  const auto whole = all_pages([&](const std::string& next) -> Answer<S3Page> {
    EXPECT_EQ(next, page == 0 ? "" : "page " + std::to_string(page));
    ++page;
    return S3Page{std::vector<S3Object>(1), page < 3 ? "page " + std::to_string(page) : ""};
  });
  ASSERT_TRUE(whole);
  EXPECT_EQ(whole->size(), 3u);
}

TEST(BucketAddress, IsRead) {
  const auto plain = parse_s3_address("s3://meshes");
  ASSERT_TRUE(plain);
  EXPECT_EQ(plain->endpoint, "https://s3.us-east-1.amazonaws.com");
  EXPECT_EQ(plain->prefix, "");
  const auto full = parse_s3_address("s3://meshes/farm/1/?endpoint=http://minio:9000&region=eu-west-3");
  ASSERT_TRUE(full);
  EXPECT_EQ(full->bucket, "meshes");
  EXPECT_EQ(full->prefix, "farm/1/");
  EXPECT_EQ(full->endpoint, "http://minio:9000");
  EXPECT_EQ(full->region, "eu-west-3");
}

TEST(BucketAddress, IsRefusedIfItIsWrong) {
  for (const char* address :
       {"meshes", "s3://", "s3:///prefix", "s3://b/pre fix", "s3://b/..", "s3://b//c", "s3://b?endpoint=minio:9000",
        "s3://b?endpoint=http://", "s3://b?region=", "s3://b?key=secret", "s3://key:secret@b/p"}) {
    const auto parsed = parse_s3_address(address);
    ASSERT_FALSE(parsed) << address;
    EXPECT_EQ(parsed.error().kind, Error::Kind::BadOption);
    EXPECT_EQ(parsed.error().sentence.find("secret"), std::string::npos) << parsed.error().sentence;
  }
}

TEST(BucketCredentials, ComeFromTheEnvironmentOrAFile) {
  const std::string path = ::testing::TempDir() + "varimesh-credentials";
  std::ofstream(path) << "[default]\naws_access_key_id = one\naws_secret_access_key = two=\n"
                         "[other]\naws_access_key_id=three\naws_secret_access_key=four\naws_session_token=five\n";
  ::setenv("AWS_SHARED_CREDENTIALS_FILE", path.c_str(), 1);
  EXPECT_EQ(read_s3_credentials()->secret, "two=");
  ::setenv("AWS_PROFILE", "other", 1);
  EXPECT_EQ(read_s3_credentials()->token, "five");
  ::setenv("AWS_PROFILE", "none", 1);
  EXPECT_EQ(read_s3_credentials().error().kind, Error::Kind::BadOption);
  EXPECT_FALSE(mesh_bucket("s3://b", {})) << "said at the start, not with the first mesh";
  ::setenv("AWS_ACCESS_KEY_ID", "six", 1);
  ::setenv("AWS_SECRET_ACCESS_KEY", "seven", 1);
  EXPECT_EQ(read_s3_credentials()->key_id, "six");
  for (const char* name : {"AWS_SHARED_CREDENTIALS_FILE", "AWS_PROFILE", "AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"})
    ::unsetenv(name);
  std::filesystem::remove(path);
}

}  // namespace
}  // namespace varimesh::server::testing
