// On which surfaces the elements lie that are not certified valid.
#pragma once

#include <string>

#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// One sentence that names the surfaces at elements that are not certified valid, with the number of such elements at
/// each. An element is at the surfaces with which it shares a node. Surfaces that have a name in `geometry` are called
/// by this name. Empty if the file cannot be read as a mesh, or if all elements are certified valid.
std::string failed_surfaces(const std::string& path, const v1::GeometryReport& geometry);

}  // namespace varimesh::client
