// A prefix of its own in the bucket of the tests, for each test.
#pragma once

#include <memory>
#include <string>

#include "server/meshes/s3/bucket_objects.h"
#include "server/meshes/shared/shared_mesh_store.h"
#include "tests/server/meshes/shared/shared_store_conformance.h"

namespace varimesh::server::testing {

/// The address of the bucket of the tests, and why there is none if it is empty.
struct BucketServer {
  std::string address, missing;
  int port = 0;
  std::string key_id = "S3RVER";  ///< Another server may want another one: VARIMESH_TEST_BUCKET_KEY_ID.
};
BucketServer bucket_server();

class InBucket : public SharedPlace {
 public:
  /// `port`: of a proxy before the server; 0: none.
  explicit InBucket(int port = 0);
  ~InBucket() override;

  std::unique_ptr<MeshStore> open(const DirectoryMeshSettings& settings, AskNeeded needed) override;
  bool has(const std::string& digest) override;
  void damage(const std::string& digest) override;
  int repetitions() const override { return 40; }

  std::shared_ptr<S3Client> client(const std::string& secret = "S3RVER");
  /// A client that reaches the server without the proxy.
  std::shared_ptr<S3Client> direct();
  std::shared_ptr<S3Client> client_at(int port, const std::string& secret);
  /// For copies of meshes, of each store another one.
  std::string new_directory();

  /// Long, since the machine may be busy with other tests.
  S3Patience patience{30'000};
  std::chrono::seconds stalled{10};  ///< S3Settings::stalled
  std::int64_t max_cache_bytes = 1 << 30;

 private:
  const int port_;
  std::string prefix_, directory_;
  int directories_ = 0;
};

}  // namespace varimesh::server::testing
