#include "client/process/exit_status.h"

#include <gtest/gtest.h>

#include <set>

namespace varimesh::client {
namespace {

TEST(ExitStatus, EachStatusHasOneMeaning) {
  std::set<int> statuses;
  for (const ExitStatusMeaning& one : exit_statuses()) {
    EXPECT_TRUE(statuses.insert(one.status).second) << one.status;
    EXPECT_FALSE(one.meaning.empty()) << one.status;
  }
  EXPECT_EQ(statuses, (std::set<int>{0, 1, 2, 3, 4, 5, 6, 130}));
}

TEST(ExitStatus, ErrorsArePrintedAndHaveAStatus) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(print_error(Error{Error::Kind::BadInput, "The mesh is bad."}), kInputRefused);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "varimesh: The mesh is bad.\n");
  EXPECT_EQ(print_error(Error{Error::Kind::Output, ""}), kInputRefused);
  EXPECT_EQ(print_error(Error{Error::Kind::BadOption, ""}), kUsage);
  EXPECT_EQ(print_error(Error{Error::Kind::Internal, ""}), kJobFailed);
}

TEST(ExitStatus, FailuresHaveAStatus) {
  EXPECT_EQ(print_error(Failure{Failure::Kind::Transport, "", "", {}}), kServer);
  EXPECT_EQ(print_error(Failure{Failure::Kind::File, "", "", {}}), kInputRefused);
  EXPECT_EQ(print_error(Failure{Failure::Kind::Interrupted, "", "", {}}), kInterrupted);
  EXPECT_EQ(print_error(Failure{Failure::Kind::Refused, "QUEUE_FULL", "", {}}), kServer);
  EXPECT_EQ(print_error(Failure{Failure::Kind::Refused, "JOB_NOT_FOUND", "", {}}), kUsage);
  EXPECT_EQ(print_error(Failure{Failure::Kind::Refused, "MESH_TOO_LARGE", "", {}}), kInputRefused);
}

TEST(ExitStatus, UncertifiedElementsAreCounted) {
  testing::internal::CaptureStderr();
  EXPECT_EQ(print_uncertified(0, 0), kDone);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  testing::internal::CaptureStderr();
  EXPECT_EQ(print_uncertified(1, 2), kInvalidLeft);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            "varimesh: 1 element is invalid\nvarimesh: 2 elements are proved neither valid nor invalid\n");
}

}  // namespace
}  // namespace varimesh::client
