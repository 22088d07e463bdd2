// Writes files and asks for room.
#include "server/meshes/disk.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <random>
#include <system_error>

#include "core/base/io/write_all.h"
#include "core/formats/formats.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

/// After how many bytes the room on the disk is looked at again.
constexpr std::int64_t kCheckedBytes = 1 << 20;

}  // namespace

std::string random_name() {
  std::random_device device;
  std::string bits;
  for (int i = 0; i < 8; ++i) bits += std::to_string(device()) + " ";
  return sha256(bits);
}

bool move_to_damaged(const std::filesystem::path& directory, const std::string& name) {
  const std::filesystem::path damaged = directory / kDamagedFolder;
  if (::mkdir(damaged.c_str(), 0700) != 0 && errno != EEXIST) return false;
  return ::rename((directory / name).c_str(), (damaged / name).c_str()) == 0 && sync_directory(damaged) &&
         sync_directory(directory);
}

Answer<void> check_size(std::int64_t size, std::int64_t max_mesh_bytes, std::int64_t max_memory_bytes) {
  if (size < 0) return bad_request("The size of a mesh must not be negative.");
  if (size > max_mesh_bytes) return mesh_too_large(max_mesh_bytes, size);
  const std::int64_t least = formats::least_memory(size);
  if (max_memory_bytes > 0 && least > max_memory_bytes) return mesh_needs_memory(max_memory_bytes, least);
  return {};
}

Answer<void> check_upload(const std::string& id, const std::string& digest, std::int64_t size,
                          std::int64_t max_mesh_bytes, std::int64_t max_memory_bytes) {
  if (id.empty() || id.size() > 128) return bad_request("The upload id must have 1 to 128 bytes.");
  if (!is_sha256(digest))
    return bad_request("The digest must be the SHA-256 of the mesh as 64 lowercase hexadecimal digits.");
  return check_size(size, max_mesh_bytes, max_memory_bytes);
}

std::int64_t next_stream() {
  static std::atomic<std::uint64_t> last = std::uint64_t{std::random_device()()} << 30U;
  return static_cast<std::int64_t>(++last);
}

std::string mark_of(const std::string& digest, const std::string& owner) { return sha256(digest + " " + owner); }

Refusal cannot_store(const std::string& why) {
  const int reason = errno;
  Refusal refusal = store_full("The server cannot store the mesh: " + why + " (" + std::strerror(reason) + ")");
  const bool may_pass = reason == ENOSPC || reason == EDQUOT || reason == EMFILE || reason == ENFILE;
  if (!may_pass) refusal.value().retry_seconds = 0;
  return refusal;
}

bool sync_directory(const std::filesystem::path& directory) {
  const int file = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return false;
  const bool synced = ::fsync(file) == 0;
  ::close(file);
  return synced;
}

bool write_at(const std::filesystem::path& path, std::int64_t offset, std::string_view bytes) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CLOEXEC | O_NOFOLLOW);
  if (file < 0) return false;
  // A chunk that the disk could not take may have left part of itself.
  const bool good =
      ::ftruncate(file, offset) == 0 && ::lseek(file, offset, SEEK_SET) == offset && write_all(file, bytes);
  const int reason = errno;
  ::close(file);
  errno = reason;
  return good;
}

Answer<std::string> name_of_directory(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / "name";
  for (int attempt = 0; attempt < 2; ++attempt) {
    std::ifstream file(path);
    if (std::string name; std::getline(file, name) && is_sha256(name)) return name;
    const std::string name = random_name();
    const std::filesystem::path part = directory / ("part-" + name);
    const int made = ::open(part.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
    if (made < 0) return cannot_store("the name of its directory cannot be written");
    const bool written = write_all(made, name + "\n") && ::fsync(made) == 0;
    ::close(made);
    // Fails if another process was first, whose name then counts.
    const bool linked = written && (::link(part.c_str(), path.c_str()) == 0 || errno == EEXIST);
    const int reason = errno;
    ::unlink(part.c_str());
    errno = reason;
    if (!linked || !sync_directory(directory)) return cannot_store("the name of its directory cannot be written");
  }
  errno = EBADMSG;
  return cannot_store("the file " + path.string() + " has no name in it; restore it, or move it away to get a new one");
}

bool disk_has_room(const std::filesystem::path& directory, std::int64_t reserve, std::int64_t bytes) {
  std::error_code error;
  const auto space = std::filesystem::space(directory, error);
  return error || static_cast<std::int64_t>(space.available) >= reserve + bytes;
}

Answer<std::unique_ptr<BlobWriter>> start_part(const std::filesystem::path& path, std::optional<std::int64_t> announced,
                                               std::atomic<std::int64_t>& promised,
                                               const std::function<bool(std::int64_t bytes)>& has_room,
                                               PartWriter::Adopt adopt) {
  std::optional<Promise> promise;
  if (announced) {
    if (!has_room(*announced + promised))
      return store_full("The server's disk has no room for a mesh of " + std::to_string(*announced) + " bytes");
    promise.emplace(promised, *announced);
  }
  const int file = ::open(path.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return cannot_store("a file cannot be created");
  return std::make_unique<PartWriter>(
      file, path, std::move(promise), [has_room] { return has_room(0); }, std::move(adopt));
}

PartWriter::~PartWriter() {
  ::close(file_);
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

bool PartWriter::append(std::string_view bytes) {
  const std::int64_t after = size_ + static_cast<std::int64_t>(bytes.size());
  // The size need not be known, and other files grow as well.
  if (promise_ && after / kCheckedBytes != size_ / kCheckedBytes && !has_room_()) {
    errno = ENOSPC;
    return false;
  }
  if (!write_all_at(file_, bytes, size_)) {
    const int reason = errno;
    // What the disk has taken of the piece gives its room back, until the piece comes again.
    [[maybe_unused]] const int cut = ::ftruncate(file_, size_);
    errno = reason;
    return false;
  }
  if (promise_) promise_->keep(static_cast<std::int64_t>(bytes.size()));
  hash_.update(bytes);
  size_ = after;
  return true;
}

}  // namespace varimesh::server
