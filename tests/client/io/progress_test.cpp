// What the progress prints when standard error is no terminal.
#include "client/io/progress.h"

#include <gtest/gtest.h>

#include <thread>

namespace varimesh::client {
namespace {

/// What a new Progress prints for the event.
std::string printed(const v1::JobEvent& event) {
  ::testing::internal::CaptureStderr();
  Progress(false, v1::Options()).show(event);
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
  Progress(true, v1::Options()).show(work(v1::Work::ACTIVITY_PRODUCTS, 12, 0));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

TEST(Progress, ShowsWorkThatTakesLongButOneLinePerSecond) {
  ::testing::internal::CaptureStderr();
  Progress progress(false, v1::Options());
  progress.show(work(v1::Work::ACTIVITY_PRODUCTS, 1, 0));
  std::this_thread::sleep_for(std::chrono::milliseconds(1050));
  for (int i = 2; i <= 5; ++i) progress.show(work(v1::Work::ACTIVITY_PRODUCTS, i, 0));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "newton    1  2 products\n");
}

}  // namespace
}  // namespace varimesh::client
