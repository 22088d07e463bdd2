// The process of a job as the server sees it: its start, its limits, its end.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "server/isolation/channel.h"
#include "server/meshes/mesh_store.h"

namespace varimesh::server {

/// Thrown if the process has ended or must be ended. As a part of a sentence: "crashed (signal 11)".
struct ProcessLost {
  std::string why;
};

/// A process that runs varimesh_worker. It is killed when this object is destroyed.
class WorkerProcess {
 public:
  /// Starts it with the bytes of the mesh and of the checkpoint, which it cannot change. Throws ProcessLost.
  WorkerProcess(const std::string& program, const Blob& mesh, std::string_view checkpoint);
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  Channel& channel() { return *channel_; }
  pid_t id() const { return id_; }
  /// Sets the most address space that the process may have, in bytes.
  void limit_memory(std::int64_t bytes) const;
  /// Waits for the end of the process, which has closed its socket, and throws ProcessLost.
  [[noreturn]] void fail_ended();

 private:
  pid_t id_ = -1;
  std::unique_ptr<Channel> channel_;
};

}  // namespace varimesh::server
