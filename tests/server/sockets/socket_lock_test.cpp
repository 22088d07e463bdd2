// One server per unix socket.
#include "server/sockets/socket_lock.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <filesystem>

#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

class SocketLockTest : public ::testing::Test {
 protected:
  SocketLockTest() {
    std::string name = ::testing::TempDir() + "varimesh-socket-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~SocketLockTest() override { std::filesystem::remove_all(folder_); }

  std::string address() const { return "unix:" + (folder_ / "socket").string(); }
  /// Binds the socket without varimeshd, and returns the descriptor. `listens`: whether it accepts connections.
  int bind_socket(bool listens) const {
    sockaddr_un name{};
    name.sun_family = AF_UNIX;
    (folder_ / "socket").string().copy(name.sun_path, sizeof name.sun_path - 1);
    const int file = ::socket(AF_UNIX, SOCK_STREAM, 0);
    EXPECT_EQ(::bind(file, reinterpret_cast<const sockaddr*>(&name), sizeof name), 0);
    if (listens) {
      EXPECT_EQ(::listen(file, 1), 0);
    }
    return file;
  }

  std::filesystem::path folder_;
};

TEST_F(SocketLockTest, RefusesASecondServer) {
  const Service first(options_with(echo_engine(), address()));
  for (const std::string& same : {address(), "unix://" + (folder_ / "socket").string()}) {
    const auto second = Server::start(options_with(echo_engine(), same));
    ASSERT_FALSE(second);
    EXPECT_NE(second.error().sentence.find("another process listens there"), std::string::npos)
        << second.error().sentence;
  }
  EXPECT_EQ(first.wait_for(first.submit(first.spec_for("a mesh")).name()).state(), v1::JOB_STATE_SUCCEEDED)
      << "new connections still reach the first server";
}

TEST_F(SocketLockTest, RefusesTheSocketOfAnotherProgram) {
  const int listener = bind_socket(true);
  EXPECT_FALSE(Server::start(options_with(echo_engine(), address())));
  ::close(listener);
}

TEST_F(SocketLockTest, TakesASocketThatNobodyListensOn) {
  ::close(bind_socket(true));
  ASSERT_TRUE(std::filesystem::exists(folder_ / "socket"));
  const Service service(options_with(echo_engine(), address()));
  EXPECT_EQ(service.wait_for(service.submit(service.spec_for("a mesh")).name()).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST_F(SocketLockTest, LeavesNothingBehind) {
  { const Service service(options_with(echo_engine(), address())); }
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

}  // namespace
}  // namespace varimesh::server::testing
