// Creates the directory and locks a file in it.
#include "server/state/state_directory.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "core/base/io/write_all.h"
#include "core/base/sha256.h"
#include "server/meshes/read_at.h"
#include "server/state/owned_path.h"

namespace varimesh::server {
namespace {

constexpr std::size_t kSecretBytes = 16;

/// Removes trailing separators and dots, since the parent path of "a/b/" would be "a/b" and not "a".
std::string without_trailing_separators(std::filesystem::path path) {
  while (path.has_relative_path() && (!path.has_filename() || path.filename() == ".") && path.has_parent_path())
    path = path.parent_path();
  return path.string();
}

}  // namespace

Expected<std::unique_ptr<StateDirectory>> StateDirectory::take(const std::string& given) {
  const std::string path = without_trailing_separators(given);
  const auto refuse = [&](const std::string& why) {
    return tl::unexpected(Error{Error::Kind::Output, "Cannot keep jobs in '" + path + "': " + why});
  };
  std::error_code error;
  if (const std::filesystem::path parent = std::filesystem::path(path).parent_path(); !parent.empty())
    std::filesystem::create_directories(parent, error);
  if (error || (::mkdir(path.c_str(), 0700) != 0 && errno != EEXIST))
    return refuse(std::string(error ? error.message() : std::strerror(errno)) +
                  "; choose another directory (--state).");
  if (const std::string why = why_not_owned(path, true); !why.empty())
    return refuse(why + "; choose another directory, or a new one inside it (--state).");
  // Without symbolic links in it, since SQLite refuses a database behind one.
  const std::filesystem::path directory = std::filesystem::canonical(path, error);
  if (error) return refuse(error.message() + "; choose another directory (--state).");
  if (::mkdir((directory / "meshes").c_str(), 0700) != 0 && errno != EEXIST)
    return refuse(std::string(std::strerror(errno)) + "; choose another directory (--state).");
  if (const std::string why = why_not_owned(directory / "meshes", false); !why.empty())
    return refuse("its folder 'meshes' cannot be used: " + why + "; choose another directory (--state).");
  const int lock = ::open((directory / "lock").c_str(), O_CREAT | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (lock < 0 && errno == ELOOP)
    return refuse("its file 'lock' is a symbolic link; remove it, or choose another directory (--state).");
  if (lock < 0) return refuse(std::string(std::strerror(errno)) + "; choose another directory (--state).");
  const char* const in_use = "another varimeshd uses it; stop that server, or choose another directory (--state).";
  // The system releases the lock when the process ends, even if it is killed.
  if (::flock(lock, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock);
    return refuse(in_use);
  }
  // The file may be deleted while it is locked; the directory itself cannot. Not every file system locks directories.
  const int folder = ::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC | O_NOFOLLOW);
  if (folder >= 0 && ::flock(folder, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    ::close(folder);
    ::close(lock);
    return refuse(in_use);
  }
  return std::unique_ptr<StateDirectory>(new StateDirectory(directory, lock, folder));
}

StateDirectory::~StateDirectory() {
  if (folder_ >= 0) ::close(folder_);
  ::close(lock_);
}

void StateDirectory::become_server() const {
  std::error_code ignored;
  std::filesystem::remove(path_ / kBackupMark, ignored);
}

std::string random_bytes() {
  std::string bytes(kSecretBytes, '\0');
  for (std::size_t filled = 0; filled < bytes.size();)
    if (const ssize_t got = ::getrandom(bytes.data() + filled, bytes.size() - filled, 0); got > 0)
      filled += static_cast<std::size_t>(got);
  return bytes;
}

std::string secret_in(const std::filesystem::path& directory) {
  const std::string path = directory / "secret", name = sha256(random_bytes()), beside = path + "." + name + ".new";
  const auto kept = [&] {
    std::string bytes;
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    if (file < 0) return bytes;
    if (!read_at(file, 0, kSecretBytes + 1, &bytes) || bytes.size() != kSecretBytes) bytes.clear();
    ::close(file);
    return bytes;
  };
  std::string bytes = kept();
  if (!bytes.empty()) return bytes;
  bytes = random_bytes();
  const int file = ::open(beside.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return bytes;
  const bool written = write_all(file, bytes);
  ::close(file);
  // Another server may do the same at this moment: the first one counts. A file that cannot be used is in nobody's way.
  const bool made = written && (::link(beside.c_str(), path.c_str()) == 0 || kept().empty());
  if (made)
    ::rename(beside.c_str(), path.c_str());
  else if (const std::string other = kept(); !other.empty())
    bytes = other;
  ::unlink(beside.c_str());
  return bytes;
}

}  // namespace varimesh::server
