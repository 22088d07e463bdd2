// Which connections may stay, so that the last descriptors are left to the server itself.
#include "server/sockets/tcp_listener.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <thread>

namespace varimesh::server {
namespace {

constexpr long kLimit = 100;  // 32 of which are kept, and 34 are the most of an address

TEST(Admission, LeavesDescriptorsToTheServer) {
  Admission admission;
  EXPECT_TRUE(admission.admits(67, "192.0.2.1", kLimit));
  EXPECT_FALSE(admission.admits(68, "192.0.2.2", kLimit));
  EXPECT_TRUE(admission.admits(68, "192.0.2.2", 2 * kLimit)) << "the limit may change while the server runs";
  EXPECT_GE(Admission::reserve(256), 64);
  EXPECT_EQ(Admission::reserve(1 << 20), 4096);
  for (const long limit : {64L, 100L, 1024L, 4096L, 1L << 20}) {
    EXPECT_GE(Admission::most_inside(limit), 12);
    EXPECT_LE(2 * Admission::most_inside(limit), Admission::reserve(limit) * 3 / 4);
  }
}

/// A file that takes a descriptor, as a connection does.
int open_file() { return ::open("/dev/null", O_RDONLY | O_CLOEXEC); }

TEST(Admission, GivesAnAddressHalf) {
  Admission admission;
  for (int i = 0; i < 34; ++i) EXPECT_TRUE(admission.admits(10 + i, "192.0.2.1", kLimit)) << i;
  EXPECT_FALSE(admission.admits(50, "192.0.2.1", kLimit));
  EXPECT_TRUE(admission.admits(50, "192.0.2.2", kLimit));
}

TEST(Admission, KnowsWhichConnectionsAreGone) {
  Admission admission;
  std::vector<int> files;
  const long limit = 2 * kLimit + 32;
  for (int i = 0; i < Admission::most_of_an_address(limit); ++i) {
    files.push_back(open_file());
    ASSERT_TRUE(admission.admits(files.back(), "192.0.2.1", limit)) << i;
  }
  const int more = open_file();
  EXPECT_FALSE(admission.admits(more, "192.0.2.1", limit));
  // One is closed, and its number is given to something else.
  int pipe[2];
  ::close(files.front());
  ASSERT_EQ(::pipe(pipe), 0);
  std::this_thread::sleep_for(std::chrono::milliseconds(300));  // it does not look at all of them each time
  EXPECT_TRUE(admission.admits(more, "192.0.2.1", limit));
  EXPECT_FALSE(admission.admits(more + 1, "192.0.2.1", limit));
  // The number of another one comes back as a connection of somebody else.
  EXPECT_TRUE(admission.admits(files.back(), "192.0.2.2", limit));
  EXPECT_TRUE(admission.admits(more + 1, "192.0.2.1", limit));
  for (const int file : files) ::close(file);
  ::close(pipe[1]);
  ::close(more);
}

TEST(TcpListener, TakesNoAddressThatIsTakenOrOfAnotherMachine) {
  const auto first = TcpListener::open("127.0.0.1:0");
  ASSERT_TRUE(first);
  EXPECT_GT((*first)->port(), 0);
  for (const std::string& address : {"127.0.0.1:" + std::to_string((*first)->port()), std::string("192.0.2.1:0")}) {
    const auto refused = TcpListener::open(address);
    ASSERT_FALSE(refused) << address;
    EXPECT_EQ(refused.error().kind, Error::Kind::Output);
    EXPECT_NE(refused.error().sentence.find(address), std::string::npos);
  }
  const auto both = TcpListener::open("0.0.0.0:0");
  EXPECT_TRUE(both);
}

}  // namespace
}  // namespace varimesh::server
