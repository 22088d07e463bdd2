// What the progress prints when standard error is no terminal.
#include "client/io/progress.h"

#include <gtest/gtest.h>

#include <thread>

namespace varimesh::client {
namespace {

/// What a new Progress prints for the event.
std::string printed(const v1::JobEvent& event) {
  ::testing::internal::CaptureStderr();
  Progress(false, v1::Options(), Follows::Job).show(event);
  return ::testing::internal::GetCapturedStderr();
}

v1::JobEvent work(v1::Work::Activity activity, int done, int of) {
  v1::JobEvent event;
  v1::Work& made = *event.mutable_bookmark()->mutable_work();
  made.set_activity(activity);
  made.set_done(done);
  made.set_of(of);
  return event;
}

TEST(Progress, NamesTheWorkInsideAnIteration) {
  const auto text = [](v1::Work::Activity activity, int done, int of) {
    return progress_text(work(activity, done, of).bookmark().work(), 1);
  };
  EXPECT_EQ(text(v1::Work::ACTIVITY_ASSEMBLY, 1, 4), "newton    1  assembly 25 %");
  EXPECT_EQ(text(v1::Work::ACTIVITY_ASSEMBLY, 5, 4), "newton    1  assembly 100 %");
  EXPECT_EQ(text(v1::Work::ACTIVITY_PRODUCTS, 12, 0), "newton    1  12 products");
  EXPECT_EQ(text(v1::Work::ACTIVITY_SWEEP, 500, 1000), "sweeps    1  nodes 50 %");
  EXPECT_EQ(text(v1::Work::ACTIVITY_UNSPECIFIED, 3, 4), "done 75 %") << "of a newer server";
}

TEST(Progress, SaysHowManyGroupsTheLastLookForSplitsHasFound) {
  v1::JobEvent event = work(v1::Work::ACTIVITY_SPLITS, 2, 0);
  event.mutable_bookmark()->mutable_work()->set_groups_left(1);
  EXPECT_EQ(progress_text(event.bookmark().work(), 1), "splits       2 looks  1 group left");
  v1::JobEvent iteration;
  iteration.mutable_iteration()->set_number(3);
  EXPECT_EQ(printed(iteration).find("left"), std::string::npos);
  iteration.mutable_iteration()->set_groups_left(12);
  EXPECT_NE(printed(iteration).find("  12 groups left"), std::string::npos);
}

TEST(Progress, SaysNothingForAnEmptyBookmarkOrIfItIsQuiet) {
  v1::JobEvent event;
  event.mutable_bookmark();
  EXPECT_EQ(printed(event), "");
  ::testing::internal::CaptureStderr();
  Progress(true, v1::Options(), Follows::Job).show(work(v1::Work::ACTIVITY_PRODUCTS, 12, 0));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(Progress, NamesTheStatesOfJobsButNotOfRunsOfThisProcess) {
  v1::JobEvent event;
  event.mutable_state_change()->set_state(v1::JOB_STATE_RUNNING);
  EXPECT_EQ(printed(event), "running\n");
  ::testing::internal::CaptureStderr();
  Progress(false, v1::Options(), Follows::Run).show(event);
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

// A word that is cut says something else: "not certified 1" of 12.
TEST(Progress, LeavesOutWholeFiguresInNarrowTerminals) {
  v1::Iteration iteration;
  iteration.set_phase(v1::PHASE_UNTANGLE);
  iteration.set_number(12345);
  iteration.set_residual(3.79e-2);
  iteration.set_min_scaled_jacobian(-0.5);
  iteration.set_invalid_elements(123456);
  iteration.set_left_elements(123456);
  iteration.set_seconds(1234.5);
  const std::string bar = "[####............] ", left = "  12 min left";
  EXPECT_EQ(iteration_text(iteration, bar, left, 200),
            bar + "untangle 12345  residual 3.79e-02  min Js <= -0.5000  not certified 123456  1234.5 s  10/s" + left);
  EXPECT_EQ(iteration_text(iteration, bar, left, 79),
            "untangle 12345  min Js <= -0.5000  not certified 123456  1234.5 s" + left);
  EXPECT_EQ(iteration_text(iteration, bar, "", 79),
            "untangle 12345  min Js <= -0.5000  not certified 123456  1234.5 s");
  for (std::size_t width = 10; width < 120; ++width) {
    const std::string text = iteration_text(iteration, bar, left, width);
    EXPECT_LE(text.size(), width);
    EXPECT_EQ(text.find("certified") == std::string::npos, text.find("certified 123456") == std::string::npos) << text;
  }
}

TEST(Progress, ShowsNoFigureOfAMeshThatWouldNotBeHandedOut) {
  const auto shown = [](double smallest, int invalid, int left) {
    v1::Iteration iteration;
    iteration.set_min_scaled_jacobian(smallest);
    iteration.set_invalid_elements(invalid);
    iteration.set_left_elements(left);
    return iteration_text(iteration, "", "", 200);
  };
  EXPECT_NE(shown(0.25, 0, 0).find("min Js <=  0.2500  not certified 0"), std::string::npos);
  EXPECT_NE(shown(-0.5, 2, 2).find("min Js <= -0.5000  not certified 2"), std::string::npos);
  EXPECT_EQ(shown(-0.5, 3, 2).find("min Js"), std::string::npos) << "a trial, from which cells would go back";
  EXPECT_EQ(shown(-0.5, 0, 0).find("min Js"), std::string::npos) << "the cells were certified before the last sweeps";
  EXPECT_EQ(shown(-0.5, 3, 2).size(), shown(-0.5, 2, 2).size()) << "the columns stay";
}

TEST(Progress, SaysHowLongTheRunWillTakeAsTheJobSaysIt) {
  v1::JobEvent event;
  event.mutable_iteration()->set_number(3);
  event.mutable_iteration()->set_seconds_left(90);
  EXPECT_NE(printed(event).find("  90 s left"), std::string::npos);
  event.mutable_iteration()->set_seconds_left(600);
  EXPECT_NE(printed(event).find("  10 min left"), std::string::npos);
  EXPECT_EQ(progress_text(work(v1::Work::ACTIVITY_SWEEP, 1, 2).bookmark().work(), 1, "  90 s left"),
            "sweeps    1  nodes 50 %  90 s left");
}

TEST(Progress, ShowsWorkThatTakesLongButOneLinePerSecond) {
  ::testing::internal::CaptureStderr();
  Progress progress(false, v1::Options(), Follows::Job);
  progress.show(work(v1::Work::ACTIVITY_PRODUCTS, 1, 0));
  std::this_thread::sleep_for(std::chrono::milliseconds(1050));
  for (int i = 2; i <= 5; ++i) progress.show(work(v1::Work::ACTIVITY_PRODUCTS, i, 0));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "newton    1  2 products\n");
}

}  // namespace
}  // namespace varimesh::client
