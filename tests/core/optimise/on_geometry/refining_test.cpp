// What refining on a model does in a run: when it comes, what it splits, and how far the mesh may grow.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "core/optimise/on_geometry/optimise_on_geometry.h"
#include "tests/core/optimise/on_geometry/disc_on_cylinder.h"

namespace varimesh {
namespace {

using testing::cylinder;
using testing::disc;
using testing::DiscMesh;
using testing::left;
using testing::on_cylinder;
using Outcome = SlideTrial::Outcome;

ResultOnGeometry refined(const HighOrderMesh& mesh, SlideOn slide, double growth, int threads = 1) {
  Options options;
  options.repair = Repair::Refine;
  options.threads = threads;
  GeometryOptions geometry;
  geometry.slide = slide;
  geometry.growth = growth;
  auto done = optimise_on_geometry(mesh, options, geometry, &cylinder());
  EXPECT_TRUE(done) << done.error().sentence;
  return done ? std::move(*done) : ResultOnGeometry();
}

TEST(OptimiseOnGeometry, RefinesTheBoundaryWhereSplitsInsideLeaveElements) {
  // At the corners of the square that became the disc, triangles of its ends have two edges on a circle. There they
  // have no area, and no node may leave the circle.
  const HighOrderMesh mesh = DiscMesh(3, 3).mesh();
  Options splits;
  splits.repair = Repair::Split;
  GeometryOptions all;
  all.slide = SlideOn::All;
  EXPECT_GT(left(optimise_on_geometry(mesh, splits, all, &cylinder()).value().result), 0);
  const ResultOnGeometry done = refined(mesh, SlideOn::All, 1.5);
  EXPECT_EQ(left(done.result), 0);
  EXPECT_GT(done.result.mesh.element_count(3), mesh.element_count(3));
  EXPECT_LE(2 * done.result.mesh.element_count(3), 3 * mesh.element_count(3));
  const CertificateSummary& came = done.result.before.certified;
  EXPECT_EQ(came.valid + came.invalid + came.undecided, static_cast<std::int64_t>(mesh.element_count(3)));
  ASSERT_TRUE(done.slid);
  EXPECT_TRUE(done.slid->slid.sentences.back().starts_with("Refining split 4 edges at surfaces 2, 3 of the model"))
      << done.slid->slid.sentences.back();
  EXPECT_TRUE(std::ranges::any_of(done.result.repairs, [](const RepairStep& step) {
    return step.sentence.starts_with("The boundary edge between nodes");
  }));
  EXPECT_EQ(done.result.mesh.coordinates, refined(mesh, SlideOn::All, 1.5, 3).result.mesh.coordinates);
}

TEST(OptimiseOnGeometry, RefinesNothingIfNothingIsLeftOrTheMeshMayNotGrow) {
  const ResultOnGeometry whole = on_cylinder(SlideOn::Auto), same = refined(disc(), SlideOn::Auto, 1.5);
  EXPECT_EQ(left(whole.result), 0);
  EXPECT_EQ(whole.result.mesh.coordinates, same.result.mesh.coordinates);
  const ResultOnGeometry stays = refined(DiscMesh(3, 3).mesh(), SlideOn::All, 1);
  EXPECT_GT(left(stays.result), 0);
  EXPECT_EQ(stays.result.mesh.element_count(3), 162u);  // splits inside are not taken either
  EXPECT_TRUE(std::ranges::none_of(
      stays.result.repairs, [](const RepairStep& step) { return step.sentence.starts_with("The boundary edge"); }));
}

TEST(OptimiseOnGeometry, MovesAllNodesTogetherBeforeItRefinesIfTheFirstRunWasShort) {
  Options options;
  options.repair = Repair::Refine;
  options.time_limit = 100;
  GeometryOptions geometry;
  geometry.growth = 2;
  const auto done = optimise_on_geometry(disc(), options, geometry, &cylinder());
  ASSERT_TRUE(done) << done.error().sentence;
  EXPECT_EQ(left(done->result), 0);
  ASSERT_EQ(done->trials.size(), 1u);
  EXPECT_EQ(done->trials[0].outcome, Outcome::Taken);
  EXPECT_EQ(done->result.mesh.element_count(3), disc().element_count(3));
}

TEST(OptimiseOnGeometry, RefinesWithoutSlidingIfThereWasNoTimeToSlide) {
  Options options;
  options.repair = Repair::Refine;
  options.time_limit = 30;
  GeometryOptions geometry;
  geometry.order = 3;
  OnGeometryHooks hooks;
  bool is_first = true;
  hooks.threads_to_slide = [&] {  // is asked when a run begins to slide: the first has 11.25 s for that
    if (std::exchange(is_first, false)) std::this_thread::sleep_for(std::chrono::duration<double>(11.4));
    return 1;
  };
  const HighOrderMesh straight = DiscMesh(3, 1).mesh();
  const auto done = optimise_on_geometry(straight, options, geometry, &cylinder(), {}, {}, hooks);
  ASSERT_TRUE(done) << done.error().sentence;
  EXPECT_EQ(left(done->result), 0);
  // Refining places nodes anew at a few edges only. Where nodes slide, all on the discs move but those on curves.
  geometry.slide = SlideOn::None;
  const auto still = optimise_on_geometry(straight, {}, geometry, &cylinder());
  ASSERT_TRUE(still) << still.error().sentence;
  const std::vector<double>&now = done->result.mesh.coordinates, &then = still->result.mesh.coordinates;
  int on_discs = 0, stayed = 0;
  for (std::size_t at = 0; at < then.size(); at += 3) {
    if (then[at + 2] != 0 && then[at + 2] != 1) continue;
    ++on_discs;
    if (std::equal(&then[at], &then[at] + 3, &now[at])) ++stayed;
  }
  EXPECT_GT(2 * stayed, on_discs) << stayed << " of " << on_discs;
  EXPECT_TRUE(std::ranges::any_of(done->result.repairs, [](const RepairStep& step) {
    return step.sentence.starts_with("The boundary edge between nodes");
  }));
}

TEST(OptimiseOnGeometry, RefinesNoMeshWithoutAModel) {
  Options options;
  options.repair = Repair::Refine;
  GeometryOptions geometry;
  geometry.slide_on = GeometrySource::Boundary;
  const auto done = optimise_on_geometry(disc(), options, geometry);
  ASSERT_FALSE(done);
  EXPECT_NE(done.error().sentence.find("needs a model"), std::string::npos) << done.error().sentence;
}

}  // namespace
}  // namespace varimesh
