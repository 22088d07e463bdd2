// Looks at who may read and write a file.
#include "server/tls/private_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace varimesh::server {
namespace {

Expected<void> check_owner(const std::string& flag, const std::string& file, struct stat* status) {
  if (::stat(file.c_str(), status) != 0) return unusable(flag, file, std::strerror(errno));
  if (status->st_uid != ::geteuid() && status->st_uid != 0)
    return unusable(flag, file,
                    "it belongs to another user (uid " + std::to_string(status->st_uid) + "); run chown on it");
  if ((status->st_mode & (S_IWGRP | S_IWOTH)) != 0)
    return unusable(flag, file, "other users can write it; run chmod go-w on it");
  return {};
}

}  // namespace

tl::unexpected<Error> unusable(const std::string& flag, const std::string& file, const std::string& why) {
  return bad_option("The file '" + file + "' of " + flag + " cannot be used: " + why + ".");
}

Expected<void> check_nobody_else_writes(const std::string& flag, const std::string& file) {
  struct stat status {};
  return check_owner(flag, file, &status);
}

Expected<void> check_file_is_private(const std::string& flag, const std::string& file) {
  struct stat status {};
  if (auto checked = check_owner(flag, file, &status); !checked) return checked;
  if ((status.st_mode & S_IROTH) != 0)
    return unusable(flag, file, "every user of this machine can read it; run chmod go-rwx on it");
  if (status.st_uid != 0 && (status.st_mode & S_IRGRP) != 0)
    return unusable(flag, file, "the users of its group can read it; run chmod go-rwx on it");
  return {};
}

}  // namespace varimesh::server
