// A place for objects that several servers use at the same time: its interface. shared_mesh_store.h keeps meshes in it.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "server/failure.h"

namespace varimesh::server {

/// How long a call goes on when the place is away or fails.
using Patience = std::chrono::milliseconds;

/// An object as somebody has seen it.
struct Object {
  std::string name;
  std::int64_t size = 0;     ///< In bytes.
  std::string tag;           ///< Changes whenever the object is put or used.
  std::int64_t changed = 0;  ///< When that was last, in nanoseconds since 1970, on the clock of the place.
};

/// The bytes of an object in a file that is open for reading.
struct OpenObject {
  int file = -1;  ///< The receiver closes it.
  std::int64_t size = 0;
  std::string version;  ///< Differs if the object was put again.
};

/// What is known of an upload.
struct UploadState {
  std::string about;           ///< What was noted with put(); empty: there is no such upload.
  std::int64_t committed = 0;  ///< The bytes that every server can read.
};

/// Keeps objects with these names:
///
///   DIGEST              the bytes of a mesh
///   DIGEST.kept         a note: the mesh is pinned
///   DIGEST.MARK         a note: the mesh belongs to an owner (mark_of())
///   upload-KEY.about    what an upload is and who receives it
///
/// What one server has stored, the others see at once. An object is there whole or not at all; so it is after a power
/// failure once a call has answered. Thread-safe. Errors of all calls: UNAVAILABLE if the place cannot be reached in
/// time, INTERNAL if it refuses, STORE_FULL.
class ObjectStore {
 public:
  virtual ~ObjectStore() = default;

  /// A directory on a disk of this server, in which large meshes are copied, and the one in which files are received.
  virtual const std::filesystem::path& scratch() const = 0;
  virtual const std::filesystem::path& directory() const = 0;
  /// A path for a new file, which nobody else uses.
  virtual std::filesystem::path new_path() = 0;

  /// Takes a whole file for a mesh, in place of the bytes that are there, and uses it. Returns its tag.
  virtual Answer<std::string> put_file(const std::string& digest, const std::filesystem::path& path, std::int64_t size,
                                       Patience patience) = 0;
  /// Stores a note, or what an upload is.
  virtual Answer<void> put(const std::string& name, std::string_view bytes, Patience patience) = 0;
  /// Returns an object; nothing if there is none.
  virtual Answer<std::optional<Object>> find(const std::string& name, Patience patience) = 0;
  /// Uses a mesh, so that nobody deletes it who has seen it before. Returns the mesh; nothing if there is none, or if
  /// somebody is just deleting it.
  virtual Answer<std::optional<Object>> use(const std::string& digest, Patience patience) = 0;
  /// Opens a mesh for reading, and uses it. `again`: what the same call gave before could not be read. NOT_FOUND;
  /// DATA_LOSS if all that the place has of the mesh is damaged.
  virtual Answer<OpenObject> get(const std::string& digest, bool again, Patience patience) = 0;
  /// Returns all objects whose names begin with this.
  virtual Answer<std::vector<Object>> list(const std::string& beginning, Patience patience) = 0;
  /// Removes a note if it is there.
  virtual Answer<void> remove(const std::string& name, Patience patience) = 0;
  /// Removes a mesh, with its pin, unless it was put or used since the tag was seen. `may_go` is asked late. Returns
  /// whether the mesh was removed.
  virtual Answer<bool> remove_unused(const std::string& digest, const std::string& tag,
                                     const std::function<Answer<bool>()>& may_go, Patience patience) = 0;
  /// Moves a mesh whose bytes have changed to a place where nobody looks for it. Returns false, and does nothing, if it
  /// is not the one that was opened.
  virtual bool set_aside(const std::string& digest, const std::string& version) = 0;

  // Uploads. `key`: "upload-" and 64 hexadecimal digits.

  /// Holds off the other streams of an upload, at all servers if the place can do that, as long as the result exists.
  /// `make`: makes the object `about` if there is none. Null if there is none.
  virtual std::shared_ptr<const void> hold(const std::string& key, bool make) = 0;
  virtual Answer<UploadState> upload_state(const std::string& key, Patience patience) = 0;
  /// The file of which all servers see each byte at once; nothing if an upload is received in a file of one server and
  /// stored in parts.
  virtual std::optional<std::filesystem::path> upload_file(const std::string& key) const = 0;
  /// Stores a part of an upload.
  virtual Answer<void> put_part(const std::string& key, std::int64_t offset, std::string_view bytes,
                                Patience patience) = 0;
  /// Appends the first `size` bytes of an upload, which are stored in parts, to a file.
  virtual Answer<void> get_parts(const std::string& key, std::int64_t size, int file, Patience patience) = 0;
  /// Removes everything of an upload.
  virtual Answer<void> remove_upload(const std::string& key, Patience patience) = 0;

  /// Whether this server is the one that is to sweep now. Another one takes its place if it ends. Nothing would be lost
  /// if two did.
  virtual bool may_sweep(std::chrono::steady_clock::time_point now) = 0;
};

}  // namespace varimesh::server
