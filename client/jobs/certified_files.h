// Certifies written files whose format changes the interior of cells.
#pragma once

#include <string>
#include <vector>

#include "client/io/outputs.h"

namespace varimesh::client {

/// Certifies the files of Nektar++ among the outputs as they are read: Nektar++ makes the interior of a 3-D cell from
/// its edges and faces, so the certificates of the job are not those of the file. A sentence about the first file with
/// elements that are not certified valid, or that cannot be read; otherwise empty.
std::string uncertified_file(const std::vector<Output>& outputs);

}  // namespace varimesh::client
