// Several meshes, side by side: one job for each, in this process or on a server, and one file for each result.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/runs/optimise_run.h"

namespace varimesh::client {

/// Optimises each mesh and writes its result into the folder `into`, under the name of the mesh. The folder is made if
/// it is not there. A mesh that is refused is no reason to leave the others out. Returns the exit status.
/// @param arguments  what all meshes have in common; it has no input mesh and no outputs
int optimise_several(OptimiseArguments arguments, const std::vector<std::string>& meshes, const std::string& into);

/// Does the same, perhaps in another way.
using SeveralRun =
    std::function<int(const OptimiseArguments&, const std::vector<std::string>& meshes, const std::string& into)>;

}  // namespace varimesh::client
