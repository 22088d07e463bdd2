// The store of meshes and results, which are named by the SHA-256 of their bytes: its interface.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "server/failure.h"

namespace varimesh::server {

/// An upload that receives no data for this long is dropped. A client that was told that the store has a mesh has this
/// long to submit a job with it.
inline constexpr auto kUploadLifetime = std::chrono::minutes(10);

/// Tells a store that several servers share which of these digests jobs need. Errors: nobody knows now.
using AskNeeded = std::function<Answer<std::set<std::string>>(const std::set<std::string>& digests)>;

/// All bytes of a stored mesh in memory, valid as long as this object exists.
class Blob {
 public:
  virtual ~Blob() = default;
  virtual std::string_view bytes() const = 0;
  /// The descriptor of an open file that has these bytes and no name, if they are in one; −1 if they are in memory.
  virtual int file() const { return -1; }
};

/// Reads a stored mesh piece by piece, with little memory. One thread at a time.
class BlobReader {
 public:
  struct Piece {
    std::string bytes;
    std::int64_t size = 0;  ///< Size of the uncompressed piece, in bytes; 0 at the end of the mesh.
    bool is_zstd = false;   ///< `bytes` is one zstd frame.
  };
  virtual ~BlobReader() = default;
  /// Size of the mesh in bytes.
  virtual std::int64_t size() const = 0;
  /// Returns the piece that begins at `offset`, which must be at most size(). `zstd`: as a frame, if that is smaller.
  virtual Answer<Piece> read(std::int64_t offset, bool zstd) = 0;
};

/// Compares a stored mesh with its digest, for a reader that is to be opened afterwards. One thread at a time.
class BlobCheck {
 public:
  virtual ~BlobCheck() = default;
  /// Reads some more of the mesh. Returns whether there is more to read.
  virtual bool step() = 0;
};

/// The name and the size of a stored mesh.
struct StoredBytes {
  std::string digest;
  std::int64_t size = 0;
};

/// Writes a result piece by piece. Nothing is stored if it is destroyed without commit().
class BlobWriter {
 public:
  virtual ~BlobWriter() = default;
  /// Returns false, with errno, if the bytes cannot be written. If the store is full, the call may be repeated.
  virtual bool append(std::string_view bytes) = 0;
  /// Puts the mesh into the store and adds a reference to it.
  virtual Answer<StoredBytes> commit() = 0;
};

/// The right of a stream to write an upload. A later stream with the same id takes the upload over.
struct UploadTicket {
  std::string id;
  std::int64_t generation = 0;
  std::int64_t committed = 0;  ///< The number of bytes that need not be sent again.
  bool complete = false;       ///< The mesh is already in the store.
  /// Room in the store for the bytes that are still to come. It is kept as long as a stream holds its ticket: an upload
  /// whose stream was cut takes no room from others.
  std::shared_ptr<const void> room = nullptr;
  std::string owner = {};
};

/// Part of what an owner may store, kept for a mesh whose bytes are still to come. It is given back with this object.
/// One thread at a time.
class KeptShare {
 public:
  virtual ~KeptShare() = default;
  /// Keeps this many bytes in all, or as many as before if that is more. OWNER_FULL if the owner may not have them
  /// beside its meshes and results and what is kept for its other meshes.
  virtual Answer<void> raise_to(std::int64_t bytes) = 0;
  /// As MeshStore::grant() for the owner, with the bytes that were kept: they do not count twice at any moment.
  virtual void grant(const std::string& digest) = 0;
};

struct UploadProgress {
  std::int64_t committed = 0;
  bool complete = false;
};

/// Stores meshes by content. Thread-safe; all calls may wait for a disk.
///
/// A mesh belongs to every owner who has sent all its bytes or has it as a result: a digest is no right to the bytes.
/// Owners do not learn of each other's meshes. For an owner without a mesh it is not there: the bytes must be sent
/// again, and are compared with the digest again. Each owner has upload ids of its own. A server that does not ask who
/// calls has the one owner "".
///
/// A mesh with references stays: commit() and retain() add a reference, release() removes one. A mesh that was
/// uploaded, or that a client was told is in the store, is pinned. Without references a pinned mesh stays until sweep()
/// deletes it; other meshes are deleted with their last reference.
class MeshStore {
 public:
  virtual ~MeshStore() = default;

  /// Returns whether the disk has room for this many bytes beside the reserve. What clients have announced and not sent
  /// yet does not count: otherwise an announcement would stop the server.
  virtual bool has_room(std::int64_t bytes = 0) const = 0;

  /// Begins an upload, or continues the upload with this id. INVALID_ARGUMENT for an id or digest of the wrong form;
  /// RESOURCE_EXHAUSTED if there is no room or the mesh is too large; ALREADY_EXISTS if the id belongs to an upload of
  /// another mesh.
  virtual Answer<UploadTicket> begin_upload(const std::string& id, const std::string& digest, std::int64_t size,
                                            const std::string& owner = {}) = 0;
  /// Appends a chunk and returns the number of bytes received so far. ABORTED if another stream has taken the upload
  /// over.
  virtual Answer<std::int64_t> append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) = 0;
  /// Compares the digest and puts the mesh into the store.
  virtual Answer<StoredBytes> finish_upload(const UploadTicket& ticket) = 0;
  /// NOT_FOUND if neither the upload nor the mesh is known.
  virtual Answer<UploadProgress> query_upload(const std::string& id, const std::string& digest,
                                              const std::string& owner = {}) = 0;

  /// Returns a writer for bytes whose digest is not known yet. `announced`: for what a client sends, its size in bytes,
  /// 0 if it is not known; such bytes leave the reserve of disk space free. Empty: a result, which may use the reserve.
  /// RESOURCE_EXHAUSTED if there is no room.
  virtual Answer<std::unique_ptr<BlobWriter>> create(std::optional<std::int64_t> announced = {}) = 0;
  /// Returns all bytes of a mesh. NOT_FOUND if it is not in the store; DATA_LOSS if the store had it, but its bytes no
  /// longer have this digest. Then it is not in the store any more, and can be uploaded again.
  virtual Answer<std::shared_ptr<const Blob>> open(const std::string& digest) = 0;
  /// Returns a reader of a mesh, whose bytes have been compared with the digest. Errors as for open().
  virtual Answer<std::unique_ptr<BlobReader>> read(const std::string& digest) = 0;
  /// Returns what compares a mesh in steps, after which read() need not do so. Null if there is nothing to do.
  virtual std::unique_ptr<BlobCheck> check(const std::string& /*digest*/) { return nullptr; }
  /// Returns the size of a mesh in bytes, without reading it. NOT_FOUND if it is not in the store.
  virtual Answer<std::int64_t> size_of(const std::string& digest) = 0;
  /// Pins a mesh and returns true, or returns false if it is not in the store.
  virtual bool pin(const std::string& digest) = 0;
  /// Like pin(), but the mesh does not stay without references: the caller is about to add one.
  virtual bool touch(const std::string& digest) = 0;
  /// Deletes a mesh that nobody refers to. NOT_FOUND if it is not in the store; FAILED_PRECONDITION if jobs refer to
  /// it. With an owner, the mesh no longer belongs to that owner, and is deleted if nobody else has or needs it.
  virtual Answer<void> remove(const std::string& digest, const std::string& owner = {}) = 0;
  /// Notes that a mesh belongs to an owner too. Does nothing if the mesh is not in the store. It is forgotten with the
  /// process: uploads are noted for good, and who has a result is known from the jobs.
  virtual void grant(const std::string& digest, const std::string& owner) = 0;
  /// The opposite of grant(): no job of the owner has the mesh any more. What the owner has uploaded, or was told to be
  /// in the store, still belongs to the owner. Does nothing in a store that servers share, where all marks are alike.
  virtual void revoke(const std::string& /*digest*/, const std::string& /*owner*/) {}
  /// Whether the mesh is in the store and belongs to the owner. All meshes belong to the owner "".
  virtual bool belongs_to(const std::string& digest, const std::string& owner) = 0;
  /// RESOURCE_EXHAUSTED (OWNER_FULL) if the meshes and results of an owner would have more bytes than one owner may
  /// have, with `more` bytes added. begin_upload() asks this by itself. Never for the owner "", and never in a store
  /// that servers share, where none knows what all others store.
  virtual Answer<void> check_share(const std::string& /*owner*/, std::int64_t /*more*/) { return {}; }
  /// The bytes of an owner's meshes and results, which may be a second old; nothing if no limit needs them.
  virtual std::optional<std::int64_t> share_of(const std::string& /*owner*/) { return {}; }
  /// Keeps room for a mesh that an owner sends without begin_upload(), which does that by itself. Null for owners
  /// without a limit. The store must outlive it.
  virtual std::unique_ptr<KeptShare> keep_share(const std::string& /*owner*/) { return nullptr; }
  /// Adds a reference. Does nothing if the mesh is not in the store.
  virtual void retain(const std::string& digest) = 0;
  /// Removes a reference.
  virtual void release(const std::string& digest) = 0;
  /// Called regularly: deletes meshes without references that are too old, and the oldest of them if the store is too
  /// large.
  virtual void sweep() = 0;
  /// Whether retain() and release() count. If not, a database says which meshes jobs need, and whose they are.
  virtual bool counts_references() const { return true; }
  /// Bytes of all meshes, as far as this server knows; nothing: another one counts them.
  virtual std::optional<std::int64_t> stored_bytes() const { return std::nullopt; }
  /// Whether compress_idle() does anything.
  virtual bool compresses() const { return false; }
  /// Called regularly, by one thread at a time; a call may take long. Compresses meshes that have not been used for a
  /// while, if the store does so. Leaves the `needed` ones, since there may be no room to expand them again. Stops if
  /// `given_up` returns true.
  virtual void compress_idle([[maybe_unused]] const std::set<std::string>& needed,
                             [[maybe_unused]] const std::function<bool()>& given_up) {}
};

}  // namespace varimesh::server
