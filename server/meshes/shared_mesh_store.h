// A mesh store in a directory that several servers use at the same time.
#pragma once

#include <sys/stat.h>

#include <map>
#include <mutex>
#include <set>

#include "server/meshes/directory_mesh_store.h"
#include "server/meshes/disk.h"

namespace varimesh::server {

/// Keeps the meshes in the files of a directory, which may be on a network drive, and nothing of them in the process:
/// what one server stores, the others have at once. No counts of references are kept. sweep() asks `needed` which
/// of the meshes that rest jobs need, and deletes what nobody needs and nobody has used for a while.
///
/// In the directory, name has the directory's name. DIGEST is a mesh; its time of change is that of its last use.
/// DIGEST.kept says that it is pinned, and DIGEST.MARK that it belongs to an owner (mark_of()). part-NAME is being
/// written. upload-KEY has the bytes that an upload has received, and upload-KEY.about says what the upload is; its
/// lock orders the streams of all servers. The server that has locked the file sweeper deletes what is not needed.
///
/// The directory's file system must rename files atomically and lock them with flock(), as ext4, xfs and NFS 4 do.
/// Meshes are not compressed.
class SharedMeshStore : public MeshStore {
 public:
  using Digests = std::set<std::string>;

  /// `scratch`: a directory of this server for copies of large meshes, which are deleted when they are closed.
  /// `needed`: tells which digests jobs need. Errors: UNAVAILABLE if the directory cannot be used.
  static Answer<std::unique_ptr<SharedMeshStore>> open_directory(const std::string& directory,
                                                                 const std::string& scratch,
                                                                 DirectoryMeshSettings settings, AskNeeded needed);

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
  struct Opened {
    int file = -1;
    std::int64_t size = 0;
    ino_t inode = 0;
  };
  /// What is known about an upload, and the lock that holds off the other streams of it.
  class About;
  /// A file as sweep() saw it, and how long it has been like this.
  struct Seen {
    std::int64_t size = 0;
    std::int64_t changed = 0;  ///< In nanoseconds since 1970, on the file system's clock.
    std::chrono::steady_clock::time_point first;
    std::chrono::steady_clock::duration
        age_before{};  ///< Its age when it was seen first, at most the lifetime less 1 h.
  };

  SharedMeshStore(std::filesystem::path directory, std::filesystem::path scratch, DirectoryMeshSettings settings,
                  AskNeeded needed)
      : directory_(std::move(directory)),
        scratch_(std::move(scratch)),
        settings_(std::move(settings)),
        needed_(std::move(needed)) {}

  std::filesystem::path path_of(const std::string& digest) const { return directory_ / digest; }
  std::filesystem::path kept_of(const std::string& digest) const { return directory_ / (digest + ".kept"); }
  std::filesystem::path mark_path(const std::string& digest, const std::string& owner) const {
    return directory_ / (digest + "." + mark_of(digest, owner));
  }
  std::filesystem::path part_path();
  /// NOT_FOUND if the mesh is not in the store.
  Answer<Opened> open_file(const std::string& digest);
  /// As DirectoryMeshStore::cannot_read().
  Refusal cannot_read(const std::string& digest, ino_t inode);
  /// Pins a mesh and returns its size; nothing if the owner does not have it.
  std::optional<std::int64_t> pin_and_measure(const std::string& digest, const std::string& owner);
  /// Gives a finished file the name of its digest.
  Answer<StoredBytes> adopt(const std::filesystem::path& path, int file, StoredBytes stored, bool pinned);
  /// Notes for good that a mesh belongs to an owner. Returns false if that fails (errno).
  bool mark(const std::string& digest, const std::string& owner);
  /// Removes a mesh if its file is there and `may_go` is true for it while nobody else can use it. Returns whether it
  /// did.
  bool remove_file(const std::string& digest, const std::function<bool(const struct stat&)>& may_go);
  /// Whether any owner has the mesh.
  bool has_owners(const std::string& digest) const;

  // shared_uploads.cpp:
  std::filesystem::path upload_path(const std::string& id, const std::string& owner) const;
  /// Keeps room for the bytes that an upload still needs; null if there is none.
  std::shared_ptr<const void> room_for(const std::string& key, std::int64_t left);
  std::shared_ptr<Promise> promise_of(const std::string& key);
  /// Ends an upload that has not changed since it was looked at.
  void drop_upload(const std::string& name);

  // shared_sweep.cpp:
  /// Notes the files of the directory, and forgets those that are gone.
  void look();
  /// Whether a file has not changed for ten minutes, as far as this server has seen it.
  bool rests(const std::string& name) const;
  /// A result that this server stored and needs no longer.
  struct Released {
    std::chrono::steady_clock::time_point when;
    std::int64_t changed = 0;  ///< Its time of change then.
  };
  /// Deletes what this server has released, unless somebody else needs it.
  void remove_released();
  /// Whether this server is the one that sweeps.
  bool is_sweeper();
  /// Uses the results that this server has stored and that no job may have yet.
  void use_fresh();
  void sweep_meshes();
  void sweep_others();

  const std::filesystem::path directory_, scratch_;
  const DirectoryMeshSettings settings_;
  const AskNeeded needed_;
  std::atomic<std::int64_t> promised_ = 0;  ///< Bytes that clients of this server have announced and not sent yet.
  std::atomic<std::int64_t> stored_ = -1;   ///< Bytes of all meshes when this server last swept; −1: it did not.
  std::mutex mutex_;                        ///< Guards the next three.
  std::map<std::string, std::weak_ptr<Promise>> promises_;  ///< By the upload's key.
  std::map<std::string, Released> released_;
  std::map<std::string, std::chrono::steady_clock::time_point> fresh_;  ///< When this server stored which results.
  std::mutex sweeping_;                                                 ///< Guards the next two.
  int sweeper_ = -1;                                                    ///< The descriptor of the file `sweeper`.
  std::map<std::string, Seen> seen_;                                    ///< By the file's name.
};

/// The time at which a file changed, in nanoseconds since 1970.
inline std::int64_t time_of_change(const struct stat& status) {
  return std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec;
}

}  // namespace varimesh::server
