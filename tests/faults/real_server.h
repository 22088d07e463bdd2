// The real varimeshd as a process that can be killed and started again on its state.
#pragma once

#include <grpcpp/grpcpp.h>
#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace varimesh::server::testing {

/// A server on a socket and a state directory of its own, in a folder that goes with it.
class RealServer {
 public:
  /// `state` empty: in the folder.
  RealServer(std::string program, std::vector<std::string> flags, std::filesystem::path state = {});
  ~RealServer();
  RealServer(const RealServer&) = delete;
  RealServer& operator=(const RealServer&) = delete;

  /// Starts it and waits until it says SERVING; how long that took. Ends the program where it does not come up.
  std::chrono::milliseconds start();
  void kill();
  /// SIGTERM; the exit status.
  int stop();

  /// Whether it says SERVING now.
  bool serves() const;
  /// A connection of its own.
  std::shared_ptr<grpc::Channel> channel() const;
  const std::filesystem::path& folder() const { return folder_; }
  pid_t process() const { return process_; }

 private:
  int wait();

  const std::string program_;
  const std::vector<std::string> flags_;
  std::filesystem::path folder_, state_;
  pid_t process_ = -1;
};

/// The reason in an error's ErrorInfo; empty where it has none.
std::string reason_of(const grpc::Status& status);

}  // namespace varimesh::server::testing
