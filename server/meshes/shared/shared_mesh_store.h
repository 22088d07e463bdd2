// A mesh store that several servers use at the same time.
#pragma once

#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <set>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/disk.h"
#include "server/meshes/shared/object_store.h"
#include "server/resources/pool.h"

namespace varimesh::server {

struct SharedMeshSettings {
  DirectoryMeshSettings meshes;
  Patience for_clients{10'000};         ///< How long a call of a client waits for the place.
  Patience for_jobs{24 * 3600 * 1000};  ///< How long a job waits: nothing is lost by that.
  std::int64_t part_bytes = 8LL << 20;  ///< After so many bytes another part of an upload is stored.
};

/// Keeps the meshes as objects (object_store.h), and nothing of them in the process: what one server stores, the others
/// have at once. No counts of references are kept. sweep() asks `needed` which of the meshes that rest jobs need, and
/// deletes what nobody needs and nobody has used for a while. Meshes are not compressed.
class SharedMeshStore : public MeshStore {
 public:
  using Digests = std::set<std::string>;

  /// `needed`: tells which digests jobs need.
  SharedMeshStore(std::unique_ptr<ObjectStore> objects, SharedMeshSettings settings, AskNeeded needed);
  ~SharedMeshStore() override;

  bool has_room(std::int64_t bytes = 0) const override;
  Answer<UploadTicket> begin_upload(const std::string& id, const std::string& digest, std::int64_t size,
                                    const std::string& owner = {}) override;
  Answer<std::int64_t> append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) override;
  Answer<StoredBytes> finish_upload(const UploadTicket& ticket) override;
  Answer<UploadProgress> query_upload(const std::string& id, const std::string& digest,
                                      const std::string& owner = {}) override;
  Answer<std::unique_ptr<BlobWriter>> create(std::optional<std::int64_t> announced = {}) override;
  Answer<std::shared_ptr<const Blob>> open(const std::string& digest) override;
  Answer<std::unique_ptr<BlobReader>> read(const std::string& digest) override;
  Answer<std::int64_t> size_of(const std::string& digest) override;
  bool pin(const std::string& digest) override;
  bool touch(const std::string& digest) override;
  Answer<void> remove(const std::string& digest, const std::string& owner = {}) override;
  void grant(const std::string& digest, const std::string& owner) override;
  bool belongs_to(const std::string& digest, const std::string& owner) override;
  /// Does nothing: the database says which meshes jobs need.
  void retain(const std::string&) override {}
  bool counts_references() const override { return false; }
  std::optional<std::int64_t> stored_bytes() const override {
    return stored_ < 0 ? std::nullopt : std::optional(stored_.load());
  }
  /// The next sweeps delete the mesh, if nobody else needs it.
  void release(const std::string& digest) override;
  void sweep() override;

 private:
  struct Upload;
  /// Pins a mesh and returns its size; nothing if the owner does not have it.
  Answer<std::optional<std::int64_t>> pin_and_measure(const std::string& digest, const std::string& owner);
  /// Whether there is an object. False also if nobody knows.
  bool has(const std::string& name);
  /// A question whether no job needs a mesh.
  std::function<Answer<bool>()> unless_needed(const std::string& digest) const;
  /// Gives a finished file to the place.
  Answer<StoredBytes> adopt(const std::filesystem::path& path, StoredBytes stored, bool pinned, Patience patience);
  /// Opens a mesh with `load`, which returns null, with errno, if that fails.
  template <class Opened>
  Answer<Opened> open_with(const std::string& digest, Patience patience,
                           const std::function<Opened(const OpenObject&)>& load);

  // uploads.cpp:
  Answer<std::shared_ptr<Upload>> find(const UploadTicket& ticket);
  std::shared_ptr<Upload> find_or_make(const std::string& key);
  /// As begin_upload(), with the lock of the upload and the place's; nothing if the mesh is there by now.
  Answer<std::optional<UploadTicket>> take_over(const std::shared_ptr<Upload>& upload, UploadTicket ticket,
                                                const std::string& digest, std::int64_t size);
  std::shared_ptr<const void> room_for(const std::shared_ptr<Upload>& upload);
  Answer<void> flush(Upload& upload);
  Answer<void> check_mine(const Upload& upload);
  Answer<void> gather(Upload& upload);
  void forget(Upload& upload);
  void drop_idle_uploads();

  // sweep.cpp:
  /// An object as this server saw it, and how long it has been like this.
  struct Resting {
    Object object;
    std::chrono::steady_clock::time_point first;
    std::chrono::steady_clock::duration age_before{};  ///< When it was seen first, at most the lifetime less 1 h.
  };
  /// Notes all objects, and forgets those that are gone. Returns false if they cannot be listed.
  bool look();
  bool rests(const Resting& seen) const;
  /// Uses the results that this server has stored and that no job may have yet.
  void use_fresh();
  /// Deletes what this server has released, unless somebody else needs it.
  void remove_released();
  void sweep_meshes();
  void sweep_others();

  const std::unique_ptr<ObjectStore> objects_;
  const SharedMeshSettings settings_;
  const AskNeeded needed_;
  std::atomic<std::int64_t> promised_ = 0;  ///< Bytes that clients of this server have announced and not sent yet.
  std::atomic<std::int64_t> stored_ = -1;   ///< Bytes of all meshes when this server last swept; −1: it did not.
  std::mutex mutex_;                        ///< Guards the next three.
  std::map<std::string, std::shared_ptr<Upload>> uploads_;  ///< By key.
  /// A result that this server has stored, or released: when, and its tag then.
  struct Stored {
    std::chrono::steady_clock::time_point when;
    std::string tag;
  };
  std::map<std::string, Stored> fresh_, released_;
  std::mutex sweeping_;                  ///< Guards the next one.
  std::map<std::string, Resting> seen_;  ///< All objects, by name.
  Pool tails_{1};                        ///< Stores the last bytes of streams that were cut.
};

}  // namespace varimesh::server
