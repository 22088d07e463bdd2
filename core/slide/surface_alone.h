// Slides the nodes of a mesh that is only a surface in space, such that it becomes no worse. Internal to core/slide.
#pragma once

#include <vector>

#include "core/slide/slide.h"

namespace varimesh::detail {

/// slide(), for a mesh that has no volume to make up for it. The number of elements that are not certified valid
/// does not rise, and if it stays, the smallest scaled Jacobian does not fall (core/merit/merit.h). Otherwise the nodes
/// of the surfaces at fault stay, and the others slide again from the start. A surface is at fault if one of its
/// elements is worse than the smallest scaled Jacobian at the start, or was certified valid and is not now. Do not call
/// it inside team.run().
SlideReport slide_alone(HighOrderMesh& mesh, Association& association, SlideOn what, std::vector<bool> fixed,
                        const Team& team);

}  // namespace varimesh::detail
