#include "client/cli/default_server.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

namespace varimesh::client {
namespace {

bool is_socket_of_this_user(const std::filesystem::path& path) {
  struct stat folder {
  }, socket{};
  // In /tmp another user could make the folder a link, and point it elsewhere later.
  const bool may_be_link = !path.native().starts_with("/tmp/");
  if ((may_be_link ? ::stat : ::lstat)(path.parent_path().c_str(), &folder) != 0 || ::lstat(path.c_str(), &socket) != 0)
    return false;
  const auto mine = [](const struct stat& status) { return status.st_uid == ::geteuid(); };
  return mine(folder) && mine(socket) && (folder.st_mode & (S_IWGRP | S_IWOTH)) == 0 && S_ISSOCK(socket.st_mode);
}

}  // namespace

Expected<std::string> default_server() {
  std::vector<std::filesystem::path> places;
  const char* state = std::getenv("VARIMESH_STATE");
  const char* runtime = std::getenv("XDG_RUNTIME_DIR");
  if (state != nullptr && *state != '\0') {
    std::error_code error;
    places.push_back(std::filesystem::absolute(state, error) / "socket");
  } else {
    if (runtime != nullptr && *runtime == '/') places.push_back(std::filesystem::path(runtime) / "varimeshd.socket");
    places.push_back("/tmp/varimeshd-" + std::to_string(::geteuid()) + "/varimeshd.socket");
  }
  for (const std::filesystem::path& place : places)
    if (is_socket_of_this_user(place)) return "unix:" + place.string();
  return bad_option("No server is named, and no varimeshd of yours listens on " + places.front().string() +
                    "; start one, or name a server with --server or VARIMESH_SERVER.");
}

}  // namespace varimesh::client
