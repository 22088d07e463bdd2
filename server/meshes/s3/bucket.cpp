// Opens the store in a bucket.
#include "server/meshes/s3/bucket.h"

#include <thread>

#include "core/base/sha256.h"
#include "server/meshes/s3/bucket_objects.h"
#include "server/meshes/shared/shared_mesh_store.h"

namespace varimesh::server {
namespace {

constexpr S3Patience kAtStart{30'000};

class Bucket : public MeshPlace {
 public:
  Bucket(S3Settings where, BucketSettings settings)
      : client_(std::make_shared<S3Client>(std::move(where))), settings_(std::move(settings)) {}

  Expected<std::string> name() override { return kept_text("name"); }
  Expected<std::string> secret() override {
    return kept_text("secret").map([](const std::string& text) { return text.substr(0, 16); });
  }
  Expected<std::unique_ptr<MeshStore>> open(const std::string& directory, const DirectoryMeshSettings& settings,
                                            AskNeeded needed) override {
    SharedMeshSettings all;
    all.meshes = settings;
    if (!settings_.runs_jobs) all.for_jobs = all.for_clients;
    auto objects = bucket_objects(client_, directory, settings_.max_cache_bytes, settings.log);
    return std::unique_ptr<MeshStore>(
        std::make_unique<SharedMeshStore>(std::move(objects), std::move(all), std::move(needed)));
  }

 private:
  /// Returns an object of 64 random hexadecimal digits.
  Expected<std::string> kept_text(const std::string& key) {
    auto text = client_->get_small(key, kAtStart);
    if (!text && text.error().code == Failure::Code::NotFound) {
      if (const auto put = client_->put_if_absent(key, random_name(), kAtStart); !put)
        return tl::unexpected(Error{Error::Kind::Output, put.error().sentence});
      // Not every S3 server knows the condition. Then the last one of several servers that start at once counts.
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
      text = client_->get_small(key, kAtStart);
    }
    if (!text) return tl::unexpected(Error{Error::Kind::Output, text.error().sentence});
    if (!is_sha256(*text))
      return tl::unexpected(Error{Error::Kind::Output, "The object '" + key +
                                                           "' of the bucket of --meshes is not one of varimeshd; "
                                                           "choose another prefix."});
    return *text;
  }

  const std::shared_ptr<S3Client> client_;
  const BucketSettings settings_;
};

}  // namespace

Expected<std::shared_ptr<MeshPlace>> mesh_bucket(const std::string& address, const BucketSettings& settings) {
  const auto parsed = parse_s3_address(address);
  if (!parsed) return tl::unexpected(parsed.error());
  if (const auto credentials = read_s3_credentials(); !credentials) return tl::unexpected(credentials.error());
  S3Settings where;
  where.address = *parsed;
  where.log = settings.log;
  return std::make_shared<Bucket>(std::move(where), settings);
}

}  // namespace varimesh::server
