// A mesh store in a bucket that several servers use at the same time.
#pragma once

#include <atomic>
#include <map>
#include <mutex>
#include <optional>
#include <set>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/disk.h"
#include "server/meshes/s3/client.h"
#include "server/meshes/s3/file_cache.h"
#include "server/resources/pool.h"

namespace varimesh::server {

struct S3MeshSettings {
  DirectoryMeshSettings meshes;
  std::int64_t max_cache_bytes = std::int64_t{4} << 30;  ///< Of the copies on this server's disk.
  S3Patience for_clients{10'000};                        ///< How long a call of a client waits for the bucket.
  S3Patience for_jobs{24 * 3600 * 1000};                 ///< How long a job waits: nothing is lost by that.
};

/// Keeps the meshes as objects of a bucket, and copies of those in use in a directory of the server. As in
/// SharedMeshStore no counts of references are kept, and what one server stores, the others have at once.
///
/// Keys, below the prefix of the address:
///
///   meshes/DIGEST/g-COPY          the bytes; each upload or result that finds none stores a copy with a new random
///   name meshes/DIGEST/x-COPY-NAME     somebody, NAME, is about to delete this copy meshes/DIGEST/used random, written
///   anew with each use meshes/DIGEST/kept            the mesh is pinned meshes/DIGEST/o-MARK          the mesh belongs
///   to an owner (mark_of()) uploads/KEY/about, p-OFFSET   what an upload is and who receives it, and what has been
///   received sweeper                       random, written anew by the server that sweeps, each time it does
///
/// A bucket has no locks, but a read sees every write that was answered before it. Deleting and using a mesh rely on
/// that, as Dekker's algorithm does: who uses it writes `used` and then looks for x-; who deletes it writes x- and then
/// looks whether `used` is what it was, and asks the database again. At least one of them sees the other, however slow
/// either is, and whatever the clocks say. Somebody who sees an x- treats that copy as gone. Nobody removes the x- of
/// another, so that several servers may sweep at once.
class S3MeshStore : public MeshStore {
 public:
  using Digests = std::set<std::string>;

  /// `directory`: of this server, for copies of meshes. `needed`: tells which digests jobs need.
  S3MeshStore(std::shared_ptr<S3Client> client, const std::string& directory, S3MeshSettings settings,
              AskNeeded needed);
  ~S3MeshStore() override;

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
  void release(const std::string& digest) override;
  void sweep() override;
  std::optional<std::int64_t> stored_bytes() const override;

 private:
  struct Upload;
  struct Copy {
    std::string name;
    std::int64_t size = 0;
    bool marked = false;  ///< Somebody is about to delete it.
  };
  /// What the bucket has of a mesh.
  struct Seen {
    std::vector<Copy> copies;
    std::string used;  ///< The tag of `used`; empty: there is none.
    std::set<std::string> owners, marks;
    /// The copy that stays, as far as anybody can see now.
    const Copy* good() const;
  };
  static std::string folder_of(const std::string& digest) { return "meshes/" + digest + "/"; }

  Answer<Seen> look_at(const std::string& digest, S3Patience patience);
  /// Notes a use of a mesh and returns its size; nothing if it is not in the bucket.
  Answer<std::optional<std::int64_t>> use(const std::string& digest, S3Patience patience);
  /// Pins a mesh and returns its size; nothing if the owner does not have it.
  Answer<std::optional<std::int64_t>> pin_and_measure(const std::string& digest, const std::string& owner);
  Answer<void> note(const std::string& key, S3Patience patience);
  /// Stores a finished file. It becomes the copy on this server's disk.
  Answer<StoredBytes> adopt(const std::filesystem::path& path, int file, StoredBytes stored, bool pinned,
                            S3Patience patience);
  struct Fetched {
    int file = -1;
    std::int64_t size = 0;
  };
  /// Opens the copy on this server's disk, which is made if there is none. `again`: the one there is damaged.
  Answer<Fetched> fetch(const std::string& digest, S3Patience patience, bool again);
  Answer<Fetched> download(const std::string& digest, const Copy& copy, S3Patience patience);
  /// Opens with `load`, which returns null and EBADMSG if the copy on the disk is damaged.
  template <class Opened>
  Answer<Opened> open_with(const std::string& digest, S3Patience patience, const std::function<Opened(Fetched)>& load);

  // s3_uploads.cpp:
  static std::string upload_key(const std::string& id, const std::string& owner);
  Answer<std::shared_ptr<Upload>> find(const UploadTicket& ticket);
  std::shared_ptr<Upload> find_or_make(const std::string& key);
  /// What the bucket knows of an upload: its line `about` and the bytes that follow each other from its begin on.
  struct Progress {
    std::string about;
    std::int64_t committed = 0;
  };
  Answer<Progress> progress_of(const std::string& key);
  Answer<void> take_over(Upload& upload, const Progress& known, const std::string& digest, std::int64_t size);
  Answer<void> flush(Upload& upload);
  Answer<void> check_mine(const Upload& upload);
  Answer<void> gather(Upload& upload);
  void forget(Upload& upload);
  void drop_idle_uploads();

  // s3_sweep.cpp:
  /// Deletes the copies of a mesh unless it was used since `used` was seen, or jobs need it. Returns whether it did.
  Answer<bool> try_remove(const std::string& digest, const std::string& used);
  bool is_sweeper();
  /// An object as this server saw it, and how long it has been like this.
  struct Resting {
    S3Object object;
    std::chrono::steady_clock::time_point first;
    std::chrono::steady_clock::duration age_before{};  ///< When it was seen first, at most the lifetime less 1 h.
  };
  /// The objects of one mesh, put together.
  struct Mesh;
  Answer<void> look();
  std::map<std::string, Mesh> meshes_seen() const;
  bool rests(const std::string& key) const;
  void use_fresh();
  void remove_released();
  void sweep_meshes();
  void sweep_others();

  const std::shared_ptr<S3Client> client_;
  const S3MeshSettings settings_;
  const AskNeeded needed_;
  FileCache cache_;
  std::atomic<std::int64_t> promised_ = 0;  ///< Bytes that clients of this server have announced and not sent yet.
  std::atomic<std::int64_t> stored_ = -1;   ///< Bytes of all meshes when this server last swept; −1: it did not.
  std::mutex mutex_;                        ///< Guards the next three.
  std::map<std::string, std::shared_ptr<Upload>> uploads_;  ///< By key.
  /// A result that this server has stored: when, and the tag of `used` then.
  struct Stored {
    std::chrono::steady_clock::time_point when;
    std::string used;
  };
  std::map<std::string, Stored> fresh_, released_;
  std::mutex sweeping_;  ///< Guards the rest.
  std::string sweeper_;  ///< The object `sweeper` when it was last read, and when it changed:
  std::chrono::steady_clock::time_point sweeper_changed_{};
  bool sweeps_ = false;
  std::optional<std::chrono::steady_clock::time_point> looked_;
  std::map<std::string, Resting> seen_;  ///< All objects, by key.
  Pool tails_{1};                        ///< Stores the last bytes of streams that were cut.
};

/// Sixteen hexadecimal digits that nobody has used before.
std::string random_digits();

}  // namespace varimesh::server
