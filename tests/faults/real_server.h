// The real varimeshd, as a process that can be killed and started again with the same state.
#pragma once

#include <grpcpp/grpcpp.h>
#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace varimesh::server::testing {

/// A server with its own unix socket and state directory, in a folder that is deleted with this object.
class RealServer {
 public:
  /// `state`: the state directory. Empty: a directory in the folder.
  RealServer(std::string program, std::vector<std::string> flags, std::filesystem::path state = {});
  ~RealServer();
  RealServer(const RealServer&) = delete;
  RealServer& operator=(const RealServer&) = delete;

  /// Starts the server and waits until it is SERVING. Returns how long that took. Ends this program if the server is
  /// not SERVING after a minute.
  std::chrono::milliseconds start();
  /// Ends the server by SIGKILL.
  void kill();
  /// Ends the server by SIGTERM and returns its exit status.
  int stop();

  /// Returns whether the server is SERVING.
  bool serves() const;
  /// Returns a new connection.
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

/// Returns the reason in the ErrorInfo of a status; empty if there is none.
std::string reason_of(const grpc::Status& status);

}  // namespace varimesh::server::testing
