// Where meshes and results lie, by content: the interface, whatever holds the bytes.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/failure.h"

namespace varimesh::server {

/// An upload that nobody touches for so long is dropped; who was told that a mesh is there has as long to refer to it.
inline constexpr auto kUploadLifetime = std::chrono::minutes(10);

/// The bytes of a stored mesh all at once, readable for as long as somebody holds this.
class Blob {
 public:
  virtual ~Blob() = default;
  virtual std::string_view bytes() const = 0;
};

/// The bytes of a stored mesh piece by piece, in little memory. One thread at a time.
class BlobReader {
 public:
  struct Piece {
    std::string bytes;
    std::int64_t size = 0;  ///< Of what they stand for; 0 at the end.
    bool is_zstd = false;   ///< They are one zstd frame.
  };
  virtual ~BlobReader() = default;
  virtual std::int64_t size() const = 0;
  /// What begins at `offset`, which is at most size(). With `zstd` as a frame where that is smaller.
  virtual Answer<Piece> read(std::int64_t offset, bool zstd) = 0;
};

/// What the store knows of a mesh.
struct StoredBytes {
  std::string digest;
  std::int64_t size = 0;
};

/// Takes a result as it is written. Destroyed without commit(), it leaves nothing.
class BlobWriter {
 public:
  virtual ~BlobWriter() = default;
  /// False where the store is full.
  virtual bool append(std::string_view bytes) = 0;
  /// The mesh is in the store, with one more reference to it.
  virtual Answer<StoredBytes> commit() = 0;
};

/// A stream's right to write an upload; a later stream with the same id takes it over.
struct UploadTicket {
  std::string id;
  std::int64_t generation = 0;
  std::int64_t committed = 0;  ///< Bytes that need not be sent again.
  bool complete = false;       ///< The mesh is in the store already.
};

struct UploadProgress {
  std::int64_t committed = 0;
  bool complete = false;
};

/// Meshes by content. All calls may come from any thread, and may wait for a disk.
/// What has references (commit() and retain() give one, release() takes one) stays. A result goes with its last one; a
/// mesh that was uploaded, or that somebody was told is there, is pinned, and goes when it is swept.
class MeshStore {
 public:
  virtual ~MeshStore() = default;

  virtual Answer<UploadTicket> begin_upload(const std::string& id, const std::string& digest, std::int64_t size) = 0;
  /// Appends a chunk and says how much is there now. ABORTED where another stream took the upload over.
  virtual Answer<std::int64_t> append(const UploadTicket& ticket, std::int64_t offset, std::string_view bytes) = 0;
  /// Compares the digest and puts the mesh into the store.
  virtual Answer<StoredBytes> finish_upload(const UploadTicket& ticket) = 0;
  virtual Answer<UploadProgress> query_upload(const std::string& id, const std::string& digest) = 0;

  /// A writer for bytes whose digest is not known yet.
  virtual Answer<std::unique_ptr<BlobWriter>> create() = 0;
  /// NOT_FOUND where it is not there.
  virtual Answer<std::shared_ptr<const Blob>> open(const std::string& digest) = 0;
  /// Likewise.
  virtual Answer<std::unique_ptr<BlobReader>> read(const std::string& digest) = 0;
  /// Whether the mesh is there; if so it stays, for as long as the store keeps what nobody touches.
  virtual bool pin(const std::string& digest) = 0;
  /// Nothing happens where it is not there.
  virtual void retain(const std::string& digest) = 0;
  virtual void release(const std::string& digest) = 0;
  /// Now and then: drops what has no references and is too old, or the oldest of it where the store is too large.
  virtual void sweep() = 0;
};

}  // namespace varimesh::server
