// Where a server listens if nobody says it.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// Returns the address of a unix socket in a folder that only this user can enter: the directory of the state or,
/// without one, XDG_RUNTIME_DIR or a folder of this user below /tmp, which is made. Errors: BadOption if its path is
/// too long for a socket; Output if the folder cannot be used.
Expected<std::string> private_socket(const std::string& state);

}  // namespace varimesh::server
