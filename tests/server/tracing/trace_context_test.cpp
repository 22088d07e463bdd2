// Which headers name a trace.
#include "server/access/trace.h"

#include <gtest/gtest.h>

namespace varimesh::server::testing {
namespace {

constexpr const char* kTrace = "4bf92f3577b34da6a3ce929d0e0e4736";
const std::string kParent = "-00f067aa0ba902b7-01";

TEST(Trace, IsReadFromATraceparent) {
  EXPECT_EQ(trace_id_of(std::string("00-") + kTrace + kParent), kTrace);
  EXPECT_EQ(trace_id_of(std::string("cc-") + kTrace + kParent + "-of a later version"), kTrace);
}

TEST(Trace, IsNotReadFromAnythingElse) {
  const std::string right = std::string("00-") + kTrace + kParent;
  for (const std::string& wrong :
       {std::string(), std::string("00"), right.substr(1), right + "0", right + "-more", "ff" + right.substr(2),
        std::string("00-") + std::string(32, '0') + kParent, "00-4BF92F3577B34DA6A3CE929D0E0E4736" + kParent,
        "00_" + right.substr(3), "0\n-" + right.substr(3), right.substr(0, 54) + "g"})
    EXPECT_EQ(trace_id_of(wrong), "") << wrong;
}

}  // namespace
}  // namespace varimesh::server::testing
