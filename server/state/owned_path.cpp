// Asks the system for the owner and the permissions of a directory.
#include "server/state/owned_path.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace varimesh::server {

std::string why_not_owned(const std::string& path, bool may_be_link) {
  const int file = ::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC | (may_be_link ? 0 : O_NOFOLLOW));
  if (file < 0) {
    struct stat link {};
    if (::lstat(path.c_str(), &link) == 0 && S_ISLNK(link.st_mode) && !may_be_link) return "it is a symbolic link";
    return std::strerror(errno);
  }
  struct stat status {};
  const bool known = ::fstat(file, &status) == 0;
  const int reason = errno;
  ::close(file);
  if (!known) return std::strerror(reason);
  if (status.st_uid != ::geteuid())
    return "it belongs to another user (uid " + std::to_string(status.st_uid) + ", but the server runs as uid " +
           std::to_string(::geteuid()) + ")";
  if ((status.st_mode & (S_IWGRP | S_IWOTH)) != 0)
    return "other users can write into it (run chmod go-w on it if only this user has used it so far)";
  return {};
}

}  // namespace varimesh::server
