// The page of the port for HTTP: a mesh is dropped, looked at and optimised there.
#pragma once

#include <span>

#include "server/http/listen.h"

namespace varimesh::server {

/// Its files. They are the same for everybody and say nothing of jobs.
std::span<const PageFile> page_files();

}  // namespace varimesh::server
