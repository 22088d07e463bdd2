// Connections that misbehave, and how the server sees itself.
#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "server/self_check.h"
#include "tests/server/service.h"

namespace varimesh::server::testing {
namespace {

/// A socket on 127.0.0.1 that is connected to `port`; if `port` is 0, one that listens and accepts nobody.
int tcp_socket(int port) {
  sockaddr_in name{};
  name.sin_family = AF_INET;
  name.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  name.sin_port = htons(static_cast<std::uint16_t>(port));
  const int file = ::socket(AF_INET, SOCK_STREAM, 0);
  const auto* address = reinterpret_cast<const sockaddr*>(&name);
  EXPECT_EQ(port > 0 ? ::connect(file, address, sizeof name) : ::bind(file, address, sizeof name), 0);
  if (port == 0) {
    EXPECT_EQ(::listen(file, 1), 0);
  }
  return file;
}

TEST(Transport, RefusesMessagesThatGrpcHasCompressed) {
  const Service service(echo_engine());
  for (const auto algorithm : {GRPC_COMPRESS_GZIP, GRPC_COMPRESS_DEFLATE}) {
    grpc::ClientContext context;
    context.set_compression_algorithm(algorithm);
    v1::SubmitJobRequest request;
    request.set_request_id(std::string(100'000, 'a'));
    v1::SubmitJobResponse response;
    EXPECT_EQ(service.jobs->SubmitJob(&context, request, &response).error_code(), grpc::StatusCode::UNIMPLEMENTED);
  }
  EXPECT_EQ(service.wait_for(service.submit(service.spec_for("a mesh")).name()).state(), v1::JOB_STATE_SUCCEEDED);
}

/// Whether the bytes are frames of HTTP/2 of which one is a GOAWAY.
bool says_goodbye(const std::string& bytes) {
  constexpr std::size_t kHead = 9;
  const auto byte = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(bytes[i])); };
  for (std::size_t at = 0; at + kHead <= bytes.size();
       at += kHead + (byte(at) << 16 | byte(at + 1) << 8 | byte(at + 2)))
    if (byte(at + 3) == 7) return true;
  return false;
}

/// Whether the server ends a connection that says this and nothing else within 20 s: it closes it or says GOAWAY, after
/// which it waits some time for an answer.
bool is_ended(const Service& service, const std::string& says) {
  const int silent = tcp_socket(service.server->port());
  EXPECT_EQ(::send(silent, says.data(), says.size(), 0), static_cast<ssize_t>(says.size()));
  std::string heard;
  char bytes[256];
  pollfd readable{silent, POLLIN, 0};
  bool ended = false;
  while (!ended && ::poll(&readable, 1, 20'000) > 0) {
    const ssize_t count = ::recv(silent, bytes, sizeof bytes, 0);
    heard.append(bytes, static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    ended = count <= 0 || says_goodbye(heard);
  }
  ::close(silent);
  return ended;
}

/// The beginning of HTTP/2, and empty SETTINGS.
const std::string kHello = "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + std::string("\0\0\0\4\0\0\0\0\0", 9);

TEST(Transport, EndsConnectionsWithoutCallsAndOldOnes) {
  for (auto limit : {&Limits::connection_idle, &Limits::connection_age}) {
    ServerOptions options = options_with(echo_engine());
    options.limits.*limit = std::chrono::milliseconds(300);
    const Service service(std::move(options));
    EXPECT_TRUE(is_ended(service, kHello));
    EXPECT_EQ(service.wait_for(service.submit(service.spec_for("a mesh")).name()).state(), v1::JOB_STATE_SUCCEEDED);
  }
}

TEST(Transport, ClosesAConnectionThatSaysNothing) {
  ServerOptions options = options_with(echo_engine());
  options.limits.handshake_timeout = std::chrono::milliseconds(300);
  const Service service(std::move(options));
  EXPECT_TRUE(is_ended(service, ""));
  EXPECT_EQ(service.wait_for(service.submit(service.spec_for("a mesh")).name()).state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(Transport, KeepsACallThatOutlivesItsConnectionsAge) {
  Gate gate;
  ServerOptions options = options_with(echo_engine(3, [&](int i) {
    if (i == 2) gate.wait();
  }));
  options.limits.connection_age = std::chrono::milliseconds(200);
  const Service service(std::move(options));
  const v1::Job job = service.submit(service.spec_for("a mesh"));
  std::thread later([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    gate.open();
  });
  grpc::Status ended;
  const auto events = service.watch(job.name(), 0, 1'000'000, &ended);
  later.join();
  EXPECT_TRUE(ended.ok()) << ended.error_message();
  EXPECT_EQ(events.back().state_change().state(), v1::JOB_STATE_SUCCEEDED);
}

TEST(SelfCheck, KnowsWhetherTheServerAnswers) {
  {
    const Service service(echo_engine());
    SelfCheck check(service.server->address());
    EXPECT_FALSE(check.answers()) << "it has not been asked";
    check.dial();
    EXPECT_TRUE(check.answers());
  }
  // As a server that has no descriptor left to accept a connection with: the system accepts it, and nobody answers.
  const int listener = tcp_socket(0);
  sockaddr_in name{};
  socklen_t size = sizeof name;
  ::getsockname(listener, reinterpret_cast<sockaddr*>(&name), &size);
  SelfCheck check("0.0.0.0:" + std::to_string(ntohs(name.sin_port)), false, std::chrono::milliseconds(300));
  check.dial();
  EXPECT_FALSE(check.answers());
  ::close(listener);
  EXPECT_TRUE(SelfCheck("").answers()) << "only this process can reach it";
}

}  // namespace
}  // namespace varimesh::server::testing
