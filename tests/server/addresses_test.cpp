// Addresses to listen on, and addresses of callers.
#include "server/addresses.h"

#include <gtest/gtest.h>

namespace varimesh::server {
namespace {

TEST(PeerAddress, HasNoPort) {
  EXPECT_EQ(peer_address("ipv4:10.0.0.7:50312"), "10.0.0.7");
  EXPECT_EQ(peer_address("ipv6:%5B2001:db8::1%5D:50312"), "2001:db8::1");
  EXPECT_EQ(peer_address("ipv6:[::1]:9"), "::1");
  EXPECT_EQ(peer_address("unix:/run/varimesh.sock"), "unix");
  EXPECT_EQ(peer_address("unix:"), "unix");
}

TEST(ListenAddress, IsLoopbackOnlyIfNoOtherMachineCanReachIt) {
  for (const char* address :
       {"127.0.0.1:50051", "127.8.7.6:0", "[::1]:80", "localhost:9464", "unix:/run/varimesh.sock"})
    EXPECT_TRUE(is_loopback(address)) << address;
  for (const char* address : {"0.0.0.0:0", "[::]:0", "10.0.0.7:80", "example.org:0", "localhost.example.org:0"})
    EXPECT_FALSE(is_loopback(address)) << address;
}

TEST(ListenAddress, NeedsAPortThatExists) {
  EXPECT_TRUE(check_listen_address("127.0.0.1:65535", {}));
  EXPECT_TRUE(check_listen_address("unix:/run/varimesh.sock", {}));
  for (const char* address : {"127.0.0.1", "127.0.0.1:", "127.0.0.1:65536", "127.0.0.1:-1", "127.0.0.1:80x"}) {
    const auto checked = check_listen_address(address, {true, true, true, true});
    ASSERT_FALSE(checked) << address;
    EXPECT_EQ(checked.error().kind, Error::Kind::BadOption) << address;
  }
}

TEST(ListenAddress, BeyondLoopbackNeedsTlsAndCallersThatAreKnown) {
  using Given = Protection;
  for (const Protection& given : {Given{}, Given{.tokens = true}, Given{.tls = true}}) {
    const auto refused = check_listen_address("0.0.0.0:50051", given);
    ASSERT_FALSE(refused);
    EXPECT_NE(refused.error().sentence.find("--insecure"), std::string::npos) << refused.error().sentence;
  }
  for (const Protection& given :
       {Given{.tls = true, .mutual = true}, Given{.tls = true, .tokens = true}, Given{.insecure = true}})
    EXPECT_TRUE(check_listen_address("0.0.0.0:50051", given));
}

TEST(ListenAddress, ASocketIsNotEncrypted) {
  EXPECT_FALSE(check_listen_address("unix:/run/varimesh.sock", {.tls = true}));
}

}  // namespace
}  // namespace varimesh::server
