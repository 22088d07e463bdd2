// Writes the results of a run.
#pragma once

#include <span>
#include <vector>

#include "core/optimise/optimiser.h"
#include "server/engine/engine.h"

namespace varimesh::server {

/// Returns the formats to write: those asked for, with UNSPECIFIED replaced by the format of the input, or by MSH 4.1
/// if that can only be read.
std::vector<v1::MeshFormat> definite_outputs(std::vector<v1::MeshFormat> outputs, v1::MeshFormat read_as);

/// Writes the results, and says what their formats have no place for. False if the run is to stop and writing makes no
/// progress. Errors: BadInput if the time limit of the request is over, Output if a sink stopped.
/// @param thickness  as for thickness_field() of core/optimise/marks/marks.h; empty: no row was grown on walls
Expected<bool> write_outputs(const Result& result, std::span<const double> thickness, const RunRequest& request,
                             v1::MeshFormat read_as, const RunHooks& hooks);

/// Has a run show its mesh while somebody watches (RunHooks::mesh_watched): at most twice per second, and for at most a
/// twentieth of its time. Large meshes are not shown. `hooks` must outlive the run.
void show_while_running(RunControl& control, const HighOrderMesh& mesh, const RunHooks& hooks);

}  // namespace varimesh::server
