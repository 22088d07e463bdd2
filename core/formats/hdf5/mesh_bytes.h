// A mesh as bytes between the library and the program for HDF5 files. Internal to core/formats/hdf5 and core/hdf.
#pragma once

#include "core/formats/common/file_allowance.h"
#include "core/formats/hdf5/stream.h"
#include "core/mesh/high_order_mesh.h"

namespace varimesh::formats::hdf5 {

void send_mesh(const HighOrderMesh& mesh, Outgoing& to);
/// The same, and frees each list once it is sent, so that sender and receiver together hold hardly more than one mesh.
void send_mesh(HighOrderMesh&& mesh, Outgoing& to);

/// Counts the memory of each list before it takes it. Throws ReadFailure if the mesh takes more than is allowed, or is
/// not whole: every number that refers to something must refer to something that the mesh has, so that no other code
/// need doubt it. Whoever sent it may send anything.
HighOrderMesh receive_mesh(Incoming& from, FileAllowance& allowance);

/// The same for the program, which is sent meshes by the library: the mesh is taken as it is. It may have notes of
/// other formats, and coordinates that are not finite.
HighOrderMesh receive_trusted_mesh(Incoming& from, FileAllowance& allowance);

}  // namespace varimesh::formats::hdf5
