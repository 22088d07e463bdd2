// How many things one address may have open.
#include "server/streams/peer_counts.h"

#include <gtest/gtest.h>

namespace varimesh::server {
namespace {

TEST(PeerCounts, LimitEachAddress) {
  PeerCounts counts(2);
  const auto a = counts.take("a");
  auto b = counts.take("a");
  EXPECT_NE(b, nullptr);
  EXPECT_EQ(counts.take("a"), nullptr);
  EXPECT_NE(counts.take("b"), nullptr);
  b.reset();
  EXPECT_NE(counts.take("a"), nullptr) << "a released place does not count";
  PeerCounts none(0);
  const auto c = none.take("a"), d = none.take("a");
  EXPECT_NE(d, nullptr);
}

}  // namespace
}  // namespace varimesh::server
