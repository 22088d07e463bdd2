// A mesh store in a directory, with one file per mesh.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "server/meshes/blobs.h"
#include "server/meshes/mesh_store.h"

namespace varimesh::server {

struct DirectoryMeshSettings {
  std::int64_t max_mesh_bytes = std::int64_t{16} << 30;  ///< Size of the largest upload.
  std::int64_t max_memory_bytes =
      0;  ///< Memory for a mesh that is read. Uploads that take more are refused. 0: no limit.
  std::int64_t max_total_bytes = 0;     ///< Size of the store above which the oldest meshes without references are
                                        ///< deleted. 0: no limit.
  std::int64_t reserve_bytes = 0;       ///< Disk space that uploads leave free.
  std::int64_t max_bytes_of_owner = 0;  ///< Size of all meshes and results of one owner. 0: no limit.
  std::chrono::minutes lifetime{7 * 24 * 60};  ///< How long a mesh without references is kept after its last use.
  std::chrono::minutes compress_after{0};      ///< Time since its last use after which a mesh is compressed. 0: never.
  /// A clock that nobody sets back or forth.
  std::function<std::chrono::steady_clock::time_point()> clock = std::chrono::steady_clock::now;
  std::function<void(const std::string&)> log = [](const std::string&) {};  ///< Called with problems that the
                                                                            ///< operator should know about.
};

/// Keeps the meshes in files, so that a mesh that nobody uses costs no memory. A file gets its name, the digest, only
/// when it is complete. Every file is compared with its digest when it is opened. One that is damaged is removed, and
/// the next upload or result with this digest takes its place. A mesh that has not been used for a while is compressed
/// if that makes it smaller; its file is then called DIGEST.zst, with the digest of the uncompressed bytes. An upload
/// that receives no data for ten minutes is dropped.
class DirectoryMeshStore : public MeshStore {
 public:
  /// Creates a directory in `parent` (empty: the system's directory for temporary files) that is deleted with the
  /// store.
  static Answer<std::unique_ptr<DirectoryMeshStore>> create(const std::string& parent, DirectoryMeshSettings settings);
  /// Uses a directory that outlives the store, and creates it if it does not exist. Everything that this store has
  /// answered is on the disk.
  static Answer<std::unique_ptr<DirectoryMeshStore>> open_directory(const std::string& directory,
                                                                    DirectoryMeshSettings settings);
  ~DirectoryMeshStore() override;

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
  std::unique_ptr<BlobCheck> check(const std::string& digest) override;
  Answer<std::int64_t> size_of(const std::string& digest) override;
  bool pin(const std::string& digest) override;
  bool touch(const std::string& digest) override;
  Answer<void> remove(const std::string& digest, const std::string& owner = {}) override;
  void grant(const std::string& digest, const std::string& owner) override;
  void revoke(const std::string& digest, const std::string& owner) override;
  bool belongs_to(const std::string& digest, const std::string& owner) override;
  Answer<void> check_share(const std::string& owner, std::int64_t more) override;
  std::optional<std::int64_t> share_of(const std::string& owner) override;
  std::unique_ptr<KeptShare> keep_share(const std::string& owner) override;
  std::optional<std::int64_t> stored_bytes() const override;
  void retain(const std::string& digest) override;
  void release(const std::string& digest) override;
  void sweep() override;
  bool compresses() const override { return settings_.compress_after.count() > 0; }
  void compress_idle(const std::set<std::string>& needed, const std::function<bool()>& given_up) override;

 private:
  struct Upload;
  class KeptBytes;
  struct Entry {
    std::int64_t size = 0;    ///< Size of the mesh in bytes.
    std::int64_t stored = 0;  ///< Size of its file in bytes.
    int references = 0;
    bool pinned = false;
    std::chrono::steady_clock::time_point touched;  ///< Time of the last use.
    Form form = Form::Plain;
    std::int64_t writing = 0;       ///< Which of all files that were stored this is.
    bool lost = false;              ///< Its file was missing or damaged. Jobs refer to the entry.
    bool stays_plain = false;       ///< Compression does not make it smaller, or it cannot be read.
    std::set<std::string> owners;   ///< Marks (mark_of()) of those who have uploaded it.
    std::set<std::string> by_jobs;  ///< Marks of those who have it through their jobs.
  };
  using Entries = std::map<std::string, Entry>;

  DirectoryMeshStore(std::filesystem::path directory, DirectoryMeshSettings settings, bool durable);
  std::filesystem::path path_of(const std::string& digest, Form form) const {
    return directory_ / (form == Form::Zstd ? digest + ".zst" : digest);
  }
  /// A file of the store, opened for reading.
  struct Opened {
    int file = -1;  ///< −1: it cannot be opened (errno).
    Form form = Form::Plain;
    std::int64_t size = 0, writing = 0;
  };
  /// Opens the file of a mesh and notes that it is used. NOT_FOUND if the mesh is not in the store.
  Answer<Opened> open_file(const std::string& digest);
  /// Opens a mesh with `load`, which takes ownership of the descriptor and returns null, with errno, if that fails.
  template <class Result>
  Answer<Result> open_with(const std::string& digest, const std::function<Result(const Opened&)>& load);
  /// The refusal of a mesh whose file could not be read for the reason errno. A file that is damaged or missing is no
  /// longer in the store.
  Refusal cannot_read(const std::string& digest, std::int64_t writing);
  /// Requires the lock. The entry of a mesh that has a file; entries_.end() if there is none.
  Entries::iterator find_stored(const std::string& digest);
  /// Requires the lock. Moves the file of a mesh to the folder `damaged`, and removes the entry unless jobs refer to
  /// it.
  void lose(Entries::iterator entry, const std::string& why);
  std::filesystem::path owners_of(const std::string& digest) const { return directory_ / (digest + ".owners"); }
  std::filesystem::path temporary_path();
  Answer<std::shared_ptr<Upload>> find(const UploadTicket& ticket);
  /// Null if the owner has the mesh by now.
  Answer<std::shared_ptr<Upload>> find_or_make(const UploadTicket& ticket, const std::string& digest,
                                               std::int64_t size);
  /// Requires the lock of the upload. Keeps room for what it still needs; null if there is none.
  std::shared_ptr<const void> room_for(Upload& upload);
  /// Requires the lock of the upload. Removes it from the store.
  void forget(const UploadTicket& ticket, Upload& upload);
  /// Requires the lock. The entry of a mesh whose file has the right size, noted as used now; entries_.end() if there
  /// is none.
  Entries::iterator use(const std::string& digest);
  /// Pins a mesh and returns its size; nothing if the owner does not have it.
  std::optional<std::int64_t> pin_and_measure(const std::string& digest, const std::string& owner);
  // directory_owners.cpp:
  /// What an owner has: never less than it is, and counted anew before anything is refused for it.
  struct Share {
    std::int64_t bytes = 0;
    std::chrono::steady_clock::time_point counted;
  };
  /// Requires the lock. As grant().
  void grant_locked(const std::string& digest, const std::string& owner);
  /// Requires the lock. As check_share().
  Answer<void> check_share_locked(const std::string& owner, std::int64_t more);
  /// Requires the lock. The bytes of all meshes, results and uploads of an owner.
  std::int64_t count_share(const std::string& owner) const;
  /// Requires the lock. Notes that an owner has more.
  void add_to_share(const std::string& owner, std::int64_t bytes);
  /// Requires the lock. Whether the mesh belongs to the owner.
  static bool belongs(const Entries::value_type& entry, const std::string& owner);
  /// Notes for good that a mesh belongs to an owner. STORE_FULL if that cannot be written.
  Answer<void> grant_for_good(const std::string& digest, const std::string& owner);
  /// Requires the lock. Writes the owners of a mesh to the disk. Returns false if that fails (errno).
  bool write_owners(const Entries::value_type& entry);
  void read_owners();
  /// Renames a finished file to its digest, or leaves it to be deleted if the store already has the mesh.
  Answer<StoredBytes> adopt(const std::filesystem::path& path, int file, StoredBytes stored, bool pinned);
  /// Undoes adopt() if the file might not outlive a power failure.
  void take_back(const std::string& digest, bool pinned, bool is_new);
  void drop_old_uploads();
  void read_directory();
  void read_entry(const std::filesystem::path& path, const std::string& digest, Form form);
  std::string next_to_compress(const std::set<std::string>& needed);
  /// Returns false if it could not be tried.
  bool compress(const std::string& digest, const std::function<bool()>& given_up);
  void drop(Entries::iterator entry);

  const std::filesystem::path directory_;
  const DirectoryMeshSettings settings_;
  const bool durable_;        ///< The directory outlives the store.
  mutable std::mutex mutex_;  ///< Guards everything below. Never held while bytes are written or hashed.
  Entries entries_;
  std::map<std::pair<std::string, std::string>, std::shared_ptr<Upload>> uploads_;  ///< By owner and id.
  std::map<std::string, Share> shares_;       ///< Of owners who have been asked for.
  std::map<std::string, std::int64_t> kept_;  ///< Bytes of KeptBytes, by owner.
  std::int64_t counter_ = 0, writings_ = 0;
  std::atomic<std::int64_t> promised_ = 0;  ///< Bytes that clients have announced and not sent yet.
};

}  // namespace varimesh::server
