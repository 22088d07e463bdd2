// Buckets for tests, and the main program of the tests of S3.
#include "tests/server/meshes/s3/buckets.h"

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>

namespace varimesh::server::testing {

BucketServer bucket_server() {
  const char* const file = std::getenv("VARIMESH_TEST_BUCKET");
  std::string line;
  if (file != nullptr) std::getline(std::ifstream(file) >> std::ws, line);
  if (!is_s3(line)) return {{}, line.empty() ? "the server that the test server.s3.start starts" : line, 0};
  const char* const key_id = std::getenv("VARIMESH_TEST_BUCKET_KEY_ID");
  return {line, {}, std::stoi(line.substr(line.rfind(':') + 1)), key_id == nullptr ? "S3RVER" : key_id};
}

InBucket::InBucket(int port) : port_(port == 0 ? bucket_server().port : port) {
  static std::atomic<int> count = 0;
  prefix_ = "test-" + std::to_string(::getpid()) + "-" + std::to_string(++count);
  std::string name = ::testing::TempDir() + "varimesh-bucket-XXXXXX";
  directory_ = ::mkdtemp(name.data());
}

InBucket::~InBucket() { std::filesystem::remove_all(directory_); }

std::shared_ptr<S3Client> InBucket::client_at(int port, const std::string& secret) {
  S3Settings settings;
  settings.address =
      *parse_s3_address("s3://varimesh/" + prefix_ + "?endpoint=http://127.0.0.1:" + std::to_string(port));
  settings.credentials = [secret]() -> Expected<S3Credentials> {
    return S3Credentials{bucket_server().key_id, secret, ""};
  };
  settings.stalled = stalled;
  return std::make_shared<S3Client>(std::move(settings));
}

std::shared_ptr<S3Client> InBucket::client(const std::string& secret) { return client_at(port_, secret); }
std::shared_ptr<S3Client> InBucket::direct() { return client_at(bucket_server().port, "S3RVER"); }

std::string InBucket::new_directory() { return directory_ + "/" + std::to_string(++directories_); }

std::unique_ptr<MeshStore> InBucket::open(const DirectoryMeshSettings& settings, AskNeeded needed) {
  SharedMeshSettings all;
  all.meshes = settings;
  all.for_clients = all.for_jobs = patience;
  auto objects = bucket_objects(client(), new_directory(), max_cache_bytes, settings.log);
  return std::make_unique<SharedMeshStore>(std::move(objects), all, std::move(needed));
}

bool InBucket::has(const std::string& digest) { return !direct()->list("meshes/" + digest + "/g-", patience)->empty(); }

void InBucket::damage(const std::string& digest) {
  const auto client = direct();
  const auto copies = client->list("meshes/" + digest + "/g-", patience);
  for (const S3Object& object : *copies) {
    std::string bytes = *client->get(object.key, 0, object.size, patience);
    bytes[0] = 'x';
    EXPECT_TRUE(client->put(object.key, bytes, patience));
  }
}

}  // namespace varimesh::server::testing

int main(int argc, char** argv) {
  ::testing::InitGoogleTest(&argc, argv);
  const std::string missing = varimesh::server::testing::bucket_server().missing;
  if (missing.empty() || ::testing::GTEST_FLAG(list_tests)) return RUN_ALL_TESTS();
  std::fprintf(stderr, "SKIPPED: the tests of meshes in a bucket do not run here; %s\n", missing.c_str());
  return 77;
}
