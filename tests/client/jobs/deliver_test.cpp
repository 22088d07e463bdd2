#include "client/jobs/deliver.h"

#include <gtest/gtest.h>

#include "client/process/exit_status.h"

namespace varimesh::client {
namespace {

/// The exit status and what is said of a job with this state, which was to make layers if `wanted`.
std::pair<int, std::string> outcome(v1::JobState state, bool wanted, int layers, int status) {
  v1::Job job;
  job.set_state(state);
  if (wanted) job.mutable_spec()->mutable_layers()->add_walls("wall");
  if (layers > 0) job.mutable_metrics()->mutable_layers()->set_layers(layers);
  ::testing::internal::CaptureStderr();
  const int found = status_with_layers(job, status);
  return {found, ::testing::internal::GetCapturedStderr()};
}

TEST(Deliver, AJobWithoutItsLayersHasAStatusOfItsOwn) {
  const auto [late, why_late] = outcome(v1::JOB_STATE_SUCCEEDED, true, 0, kDone);
  EXPECT_EQ(late, kPartLeft);
  EXPECT_NE(why_late.find("has no layers, because the run ran out of time before it made them"), std::string::npos);
  const auto [stopped, why_stopped] = outcome(v1::JOB_STATE_CANCELLED, true, 0, kDone);
  EXPECT_EQ(stopped, kPartLeft);
  EXPECT_NE(why_stopped.find("was stopped before it made them"), std::string::npos);
  EXPECT_EQ(outcome(v1::JOB_STATE_SUCCEEDED, true, 0, kInvalidLeft).first, kInvalidLeft) << "which is worse";
}

TEST(Deliver, AJobWithItsLayersOrThatWantedNoneEndsAsItDid) {
  for (const auto& [wanted, layers] : {std::pair(true, 3), std::pair(false, 0)}) {
    const auto [status, said] = outcome(v1::JOB_STATE_SUCCEEDED, wanted, layers, kDone);
    EXPECT_EQ(status, kDone);
    EXPECT_EQ(said, "");
  }
}

}  // namespace
}  // namespace varimesh::client
