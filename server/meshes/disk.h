// What the mesh stores on a disk share: checks of uploads, files that are being written, and names of directories.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "core/base/sha256.h"
#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// Checks the size that a client says its mesh has, in bytes; limits as below. Errors: INVALID_ARGUMENT for a negative
/// one, with which sums of room would come out too small; RESOURCE_EXHAUSTED.
Answer<void> check_size(std::int64_t size, std::int64_t max_mesh_bytes, std::int64_t max_memory_bytes);

/// Checks what a client says about its upload. `max_mesh_bytes`: size of the largest mesh. `max_memory_bytes`: memory
/// for a mesh that is read; 0: no limit. Errors as for MeshStore::begin_upload().
Answer<void> check_upload(const std::string& id, const std::string& digest, std::int64_t size,
                          std::int64_t max_mesh_bytes, std::int64_t max_memory_bytes);

/// The number of a new stream of an upload (UploadTicket::generation): positive, and like no other, also of other
/// processes. The upload that a late stream is for may have ended, and another may have its id by then.
std::int64_t next_stream();

/// What stands for an owner of a mesh on the disk: 64 hexadecimal digits. A flipped bit in them makes the mesh
/// nobody's.
std::string mark_of(const std::string& digest, const std::string& owner);

/// The refusal of a mesh that the disk cannot take, for the reason `why` and errno.
Refusal cannot_store(const std::string& why);

/// Writes the names of new files in a directory to the disk. Returns false if that fails (errno).
bool sync_directory(const std::filesystem::path& directory);

/// Writes bytes at an offset of a file, which has nothing behind it afterwards. Returns false if that fails (errno).
bool write_at(const std::filesystem::path& path, std::int64_t offset, std::string_view bytes);

/// Returns 64 hexadecimal digits that nobody has used before.
std::string random_name();

/// The folder of a directory of meshes for files whose bytes have changed.
inline constexpr char kDamagedFolder[] = "damaged";

/// Moves a file of a directory of meshes, whose bytes have changed, into its folder `damaged`, where an operator finds
/// it. Returns false if that fails (errno).
bool move_to_damaged(const std::filesystem::path& directory, const std::string& name);

/// Returns the name of a directory of meshes: 64 hexadecimal digits in its file `name`, which is made if there is none.
/// Two processes that make it at the same time get the same name. Errors: STORE_FULL if it cannot be made.
Answer<std::string> name_of_directory(const std::filesystem::path& directory);

/// Bytes that a client has announced and not sent yet, counted until they have come or this object is destroyed.
class Promise {
 public:
  Promise(std::atomic<std::int64_t>& all, std::int64_t bytes) : all_(&all), left_(bytes) { *all_ += left_; }
  Promise(Promise&& other) noexcept : all_(other.all_), left_(std::exchange(other.left_, 0)) {}
  ~Promise() { *all_ -= left_; }
  /// These bytes have come.
  void keep(std::int64_t bytes) {
    const std::int64_t kept = std::min(bytes, left_);
    left_ -= kept;
    *all_ -= kept;
  }

 private:
  std::atomic<std::int64_t>* all_;
  std::int64_t left_;
};

/// Writes a result to a temporary file and hashes it. The file is deleted with this object unless commit() renamed it.
class PartWriter : public BlobWriter {
 public:
  /// Gives the finished file its name.
  using Adopt = std::function<Answer<StoredBytes>(const std::filesystem::path& path, int file, StoredBytes stored)>;

  /// `file`: the descriptor of the new file at `path`, which this object closes. `promise`: empty for a result, which
  /// may use the reserve of the disk; otherwise `has_room` is asked while the file grows.
  PartWriter(int file, std::filesystem::path path, std::optional<Promise> promise, std::function<bool()> has_room,
             Adopt adopt)
      : file_(file),
        path_(std::move(path)),
        promise_(std::move(promise)),
        has_room_(std::move(has_room)),
        adopt_(std::move(adopt)) {}
  ~PartWriter() override;
  bool append(std::string_view bytes) override;
  Answer<StoredBytes> commit() override { return adopt_(path_, file_, {hash_.finish(), size_}); }

 private:
  const int file_;
  const std::filesystem::path path_;
  std::optional<Promise> promise_;
  const std::function<bool()> has_room_;
  const Adopt adopt_;
  Sha256 hash_;
  std::int64_t size_ = 0;
};

/// Whether the disk of a directory has room for this many bytes beside the reserve. True if the disk does not say.
bool disk_has_room(const std::filesystem::path& directory, std::int64_t reserve, std::int64_t bytes);

/// Makes the file `path` and a writer for it. `announced`, `has_room` and `adopt` as for MeshStore::create() and
/// PartWriter. `promised`: the bytes that clients have announced and not sent yet; it must outlive the writer. Errors:
/// STORE_FULL.
Answer<std::unique_ptr<BlobWriter>> start_part(const std::filesystem::path& path, std::optional<std::int64_t> announced,
                                               std::atomic<std::int64_t>& promised,
                                               const std::function<bool(std::int64_t bytes)>& has_room,
                                               PartWriter::Adopt adopt);

}  // namespace varimesh::server
