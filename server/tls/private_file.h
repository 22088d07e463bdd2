// Whether files that a user names for keys and authorities can be trusted.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::server {

/// BadOption that says why the file of a flag cannot be used.
tl::unexpected<Error> unusable(const std::string& flag, const std::string& file, const std::string& why);

/// Checks that the file belongs to the user of this process or to root, and that nobody else may write it. Errors:
/// BadOption, with the reason.
Expected<void> check_nobody_else_writes(const std::string& flag, const std::string& file);

/// Checks besides that nobody else may read the file. One of root's may be readable by a group, since that is how
/// systems hand keys to services. Errors: BadOption, with the reason.
Expected<void> check_file_is_private(const std::string& flag, const std::string& file);

}  // namespace varimesh::server
