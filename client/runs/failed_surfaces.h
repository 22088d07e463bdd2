// On which surfaces the elements lie that are not certified valid.
#pragma once

#include <string>

#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {

/// One sentence that names the surfaces, with the number of elements at each: those of an element are the surfaces with
/// which it shares a node. Surfaces that `geometry` knows by a name are called so. Empty if the file cannot be read as
/// a mesh, or if all elements are certified valid.
std::string failed_surfaces(const std::string& path, const v1::GeometryReport& geometry);

}  // namespace varimesh::client
