// Slides boundary nodes on a CAD model and measures each boundary element before and after.
#pragma once

#include <optional>

#include "core/slide/distance/boundary_distances.h"
#include "core/slide/on_file/slide_on_file.h"

namespace varimesh {

struct SlidAndMeasured {
  SlidOnGeometry slid;  ///< The sentences about the distances are among its sentences.
  /// Nothing if the mesh lies in a plane, or if the work was stopped after the nodes had slid. If the mesh was curved
  /// too, nothing is known from before (BoundaryDistances::forget_before()).
  std::optional<BoundaryDistances> distances;
};

/// slide_on_model() with distances. Errors, and what it throws: as slide_on_model().
Expected<SlidAndMeasured> slide_and_measure(HighOrderMesh& mesh, const GeometryOptions& options,
                                            const geometry::Geometry& model);

/// The same on the model in the file `options.file`, which is not empty. Errors: those of geometry::load() too.
Expected<SlidAndMeasured> slide_and_measure(HighOrderMesh& mesh, const GeometryOptions& options);

}  // namespace varimesh
