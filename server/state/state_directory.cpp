// Creates the directory and locks a file in it.
#include "server/state/state_directory.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "server/state/owned_path.h"

namespace varimesh::server {
namespace {

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
  // The system releases the lock when the process ends, even if it is killed.
  if (::flock(lock, LOCK_EX | LOCK_NB) != 0) {
    ::close(lock);
    return refuse("another varimeshd uses it; stop that server, or choose another directory (--state).");
  }
  return std::unique_ptr<StateDirectory>(new StateDirectory(directory, lock));
}

StateDirectory::~StateDirectory() { ::close(lock_); }

}  // namespace varimesh::server
