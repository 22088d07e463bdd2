// Whether a directory can be trusted with the files of a server: nobody else may have put anything into it.
#pragma once

#include <string>

namespace varimesh::server {

/// Returns why the server cannot keep its files in this directory; empty: it can. The directory must belong to the user
/// of this process, and nobody else may be able to write into it: otherwise another user could replace files, or lead
/// the server through symbolic links to files of its own. `may_be_link`: whether `path` itself may be a symbolic link.
std::string why_not_owned(const std::string& path, bool may_be_link);

}  // namespace varimesh::server
