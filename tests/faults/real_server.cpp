// Starts the server, ends it and waits for it.
#include "tests/faults/real_server.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>
#include <utility>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "grpc/health/v1/health.grpc.pb.h"

namespace varimesh::server::testing {
namespace {

using std::chrono::steady_clock;

bool says_serving(const std::shared_ptr<grpc::Channel>& channel) {
  grpc::ClientContext context;
  // A call that waits makes the channel connect at once. Otherwise the channel would try only every five seconds.
  context.set_wait_for_ready(true);
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(1));
  grpc::health::v1::HealthCheckResponse response;
  const auto status = grpc::health::v1::Health::NewStub(channel)->Check(&context, {}, &response);
  return status.ok() && response.status() == grpc::health::v1::HealthCheckResponse::SERVING;
}

}  // namespace

RealServer::RealServer(std::string program, std::vector<std::string> flags, std::filesystem::path state)
    : program_(std::move(program)), flags_(std::move(flags)), state_(std::move(state)) {
  std::string name = (std::filesystem::temp_directory_path() / "varimesh-faults-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) std::perror(name.c_str()), std::exit(1);
  folder_ = name;
  if (state_.empty()) state_ = folder_ / "state";
}

RealServer::~RealServer() {
  if (process_ > 0) kill();
  std::filesystem::remove_all(folder_);
}

bool RealServer::serves() const { return says_serving(channel()); }

std::shared_ptr<grpc::Channel> RealServer::channel() const {
  static std::atomic<int> number = 0;
  grpc::ChannelArguments arguments;
  arguments.SetInt("varimesh.channel", ++number);
  arguments.SetInt(GRPC_ARG_INITIAL_RECONNECT_BACKOFF_MS, 20);
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, 1000);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, 100);
  return grpc::CreateCustomChannel("unix:" + (folder_ / "socket").string(), grpc::InsecureChannelCredentials(),
                                   arguments);
}

std::chrono::milliseconds RealServer::start() {
  const auto begun = steady_clock::now();
  std::vector<std::string> words{program_,        "--listen",    "unix:" + (folder_ / "socket").string(), "--state",
                                 state_.string(), "--port-file", (folder_ / "address").string()};
  words.insert(words.end(), flags_.begin(), flags_.end());
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t files;
  ::posix_spawn_file_actions_init(&files);
  ::posix_spawn_file_actions_addopen(&files, STDERR_FILENO, (folder_ / "log").c_str(), O_CREAT | O_APPEND | O_WRONLY,
                                     0600);
  const int failed = ::posix_spawn(&process_, program_.c_str(), &files, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&files);
  const auto connection = channel();
  if (failed != 0) {
    std::fprintf(stderr, "%s cannot be started: %s\n", program_.c_str(), std::strerror(failed));
    std::_Exit(1);
  }
  while (steady_clock::now() - begun < std::chrono::seconds(60)) {
    if (says_serving(connection))
      return std::chrono::duration_cast<std::chrono::milliseconds>(steady_clock::now() - begun);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  std::fprintf(stderr, "%s is not ready after a minute; its log is %s\n", program_.c_str(), (folder_ / "log").c_str());
  std::_Exit(1);
}

int RealServer::wait() {
  int status = 0;
  ::waitpid(std::exchange(process_, -1), &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

void RealServer::kill() {
  ::kill(process_, SIGKILL);
  wait();
}

int RealServer::stop() {
  ::kill(process_, SIGTERM);
  return wait();
}

std::string reason_of(const grpc::Status& status) {
  google::rpc::Status full;
  google::rpc::ErrorInfo info;
  if (full.ParseFromString(status.error_details()))
    for (const auto& detail : full.details())
      if (detail.UnpackTo(&info)) return info.reason();
  return {};
}

}  // namespace varimesh::server::testing
