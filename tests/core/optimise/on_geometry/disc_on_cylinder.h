// A coarse disc that was drawn out into a solid cylinder, and runs on the model of the cylinder.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>

#include "core/optimise/on_geometry/optimise_on_geometry.h"
#include "tests/core/support/disc_mesh.h"

namespace varimesh::testing {

inline const geometry::Geometry& cylinder() {
  static const geometry::Geometry model = solid_cylinder();
  return model;
}

/// Sliding from the bottom up leaves elements in this mesh, and moving all nodes together leaves none.
inline const HighOrderMesh& disc() {
  static const HighOrderMesh mesh = DiscMesh(2, 3).mesh();
  return mesh;
}

inline ResultOnGeometry on_cylinder(SlideOn slide, const Options& options = {}, const RunControl& control = {},
                                    const OnGeometryHooks& hooks = {}, const OnIteration& on_iteration = {}) {
  GeometryOptions geometry;
  geometry.slide = slide;
  auto done = optimise_on_geometry(disc(), options, geometry, &cylinder(), on_iteration, control, hooks);
  EXPECT_TRUE(done) << done.error().sentence;
  return done ? std::move(*done) : ResultOnGeometry();
}

inline std::int64_t left(const Result& result) {
  return result.after.certified.invalid + result.after.certified.undecided;
}

}  // namespace varimesh::testing
