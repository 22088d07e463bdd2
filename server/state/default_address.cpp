// Finds a folder for a socket.
#include "server/state/default_address.h"

#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

#include "server/state/owned_path.h"

namespace varimesh::server {
namespace {

/// Returns a folder of this user for what lasts as long as a session.
Expected<std::filesystem::path> runtime_folder() {
  const char* given = std::getenv("XDG_RUNTIME_DIR");
  if (given != nullptr && *given == '/' && why_not_owned(given, true).empty()) return given;
  const std::string made = "/tmp/varimeshd-" + std::to_string(::geteuid());
  std::string why;
  if (::mkdir(made.c_str(), 0700) != 0 && errno != EEXIST) why = std::strerror(errno);
  if (why.empty()) why = why_not_owned(made, false);
  if (why.empty()) return made;
  return tl::unexpected(
      Error{Error::Kind::Output, "The folder " + made + " cannot be used for the server's socket: " + why +
                                     "; give --state DIR, or --listen unix:PATH in a folder of your own."});
}

}  // namespace

Expected<std::string> private_socket(const std::string& state) {
  std::filesystem::path folder;
  if (state.empty()) {
    auto found = runtime_folder();
    if (!found) return tl::unexpected(found.error());
    folder = std::move(*found);
  } else {
    std::error_code error;
    folder = std::filesystem::absolute(state, error);
  }
  const std::string path = (folder / (state.empty() ? "varimeshd.socket" : "socket")).string();
  if (path.size() >= sizeof(sockaddr_un::sun_path) || path.find('%') != std::string::npos)
    return bad_option("The path '" + path + "' is too long for a unix socket or has a '%'; give --listen.");
  return "unix:" + path;
}

}  // namespace varimesh::server
