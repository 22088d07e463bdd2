// The server that commands call if none is named.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::client {

/// The address of the socket on which a varimeshd of this user listens if nobody has given it an address: `socket` in
/// the directory that VARIMESH_STATE names, otherwise varimeshd.socket in XDG_RUNTIME_DIR or in /tmp/varimeshd-UID.
/// Errors: BadOption if there is no such socket; the sentence says what to do. A socket in a folder that belongs to
/// another user, or into which others can write, does not count.
Expected<std::string> default_server();

}  // namespace varimesh::client
