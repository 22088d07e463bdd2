// Meshes in a directory of their own, one file a digest.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "server/meshes/blobs.h"
#include "server/meshes/mesh_store.h"

namespace varimesh::server {

struct DirectoryMeshSettings {
  std::int64_t max_mesh_bytes = std::int64_t{16} << 30;  ///< Larger uploads are refused.
  std::int64_t max_total_bytes = 0;            ///< Beyond it the oldest go that nothing refers to; 0: no limit.
  std::int64_t reserve_bytes = 0;              ///< Of the disk, that no upload may take.
  std::chrono::minutes lifetime{7 * 24 * 60};  ///< Of what nothing refers to, since it was last asked for.
  std::chrono::minutes compress_after{0};      ///< Since it was last asked for; 0: never.
  std::function<std::chrono::system_clock::time_point()> clock = std::chrono::system_clock::now;
  std::function<void(const std::string&)> log = [](const std::string&) {};  ///< What its keeper should know.
};

/// Keeps the bytes in files, so that a mesh that nobody works on costs no memory, and maps them where they are read. A
/// file has its name, the digest, only when all of it is there. What nobody has asked for in a while is compressed
/// where that makes it smaller, under the digest and ".zst"; the digest stays that of the bytes. Uploads that nobody
/// touched for ten minutes are dropped.
class DirectoryMeshStore : public MeshStore {
 public:
  /// Makes a directory under `parent` (empty: the system's for temporary files) that goes with the store.
  static Answer<std::unique_ptr<DirectoryMeshStore>> create(const std::string& parent, DirectoryMeshSettings settings);
  /// Makes the directory or goes on with what is in it. What it has answered is on the disk.
  static Answer<std::unique_ptr<DirectoryMeshStore>> open_directory(const std::string& directory,
                                                                    DirectoryMeshSettings settings);
  ~DirectoryMeshStore() override;

  /// Whether the disk has more than the reserve.
  bool has_room(std::int64_t bytes = 0) const;

  Answer<UploadTicket> begin_upload(const std::string& id, const std::string& digest, std::int64_t size) override;
  Answer<std::int64_t> append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) override;
  Answer<StoredBytes> finish_upload(const UploadTicket& ticket) override;
  Answer<UploadProgress> query_upload(const std::string& id, const std::string& digest) override;
  Answer<std::unique_ptr<BlobWriter>> create() override;
  Answer<std::shared_ptr<const Blob>> open(const std::string& digest) override;
  Answer<std::unique_ptr<BlobReader>> read(const std::string& digest) override;
  bool pin(const std::string& digest) override;
  void retain(const std::string& digest) override;
  void release(const std::string& digest) override;
  void sweep() override;
  /// Now and then, by one thread at a time, which may be long at it: compresses what nobody has asked for in a while,
  /// but for what is needed soon: expanding it again may find no room.
  void compress_idle(const std::set<std::string>& needed, const std::function<bool()>& given_up);

 private:
  class Writer;
  struct Upload;
  struct Entry {
    std::int64_t size = 0;
    std::int64_t stored = 0;  ///< Of its file.
    int references = 0;
    bool pinned = false;
    std::chrono::system_clock::time_point touched;
    Form form = Form::Plain;
    bool stays_plain = false;  ///< Compressing makes it no smaller, or it cannot be read.
  };
  using Entries = std::map<std::string, Entry>;

  DirectoryMeshStore(std::filesystem::path directory, DirectoryMeshSettings settings, bool durable);
  std::filesystem::path path_of(const std::string& digest, Form form) const {
    return directory_ / (form == Form::Zstd ? digest + ".zst" : digest);
  }
  /// With the lock held: the file of an entry, open for reading; −1 where it cannot be opened (errno).
  int open_file(Entries::const_iterator entry) const;
  tl::unexpected<Failure> unreadable(const std::string& digest) const;
  std::filesystem::path temporary_path();
  Answer<std::shared_ptr<Upload>> find(const UploadTicket& ticket);
  Answer<std::shared_ptr<Upload>> find_or_make(const std::string& id, const std::string& digest, std::int64_t size);
  /// With the upload's lock held: it has ended.
  void forget(const std::string& id, Upload& upload);
  bool pin(const std::string& digest, std::int64_t* size);
  /// Renames a finished file to its digest, or drops it where the digest is there already.
  Answer<StoredBytes> adopt(const std::filesystem::path& path, int file, StoredBytes stored, bool pinned);
  /// Undoes adopt(), whose file may not outlive a power cut.
  void take_back(const std::string& digest, bool pinned, bool is_new);
  void drop_old_uploads();
  void read_directory();
  void read_entry(const std::filesystem::path& path, const std::string& digest, Form form);
  std::string next_to_compress(const std::set<std::string>& needed);
  /// False where it could not be tried.
  bool compress(const std::string& digest, const std::function<bool()>& given_up);
  /// With the lock held: what compressing could not read is not tried again.
  void give_up_reading(Entries::iterator entry, bool is_gone, int reason);
  void drop(Entries::iterator entry);

  const std::filesystem::path directory_;
  const DirectoryMeshSettings settings_;
  const bool durable_;  ///< The directory outlives the store.
  std::mutex mutex_;    ///< Guards everything below; never held while bytes are written or hashed.
  Entries entries_;
  std::map<std::string, std::shared_ptr<Upload>> uploads_;
  std::int64_t counter_ = 0;
};

}  // namespace varimesh::server
