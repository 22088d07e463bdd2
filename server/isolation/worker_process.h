// The process of a job as the server sees it: its start, its limits, its end.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

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
  /// Starts it. It waits for its first message. Throws ProcessLost.
  explicit WorkerProcess(const std::string& program);
  ~WorkerProcess();
  WorkerProcess(const WorkerProcess&) = delete;
  WorkerProcess& operator=(const WorkerProcess&) = delete;

  Channel& channel() { return *channel_; }
  pid_t id() const { return id_; }
  /// Whether it still runs.
  bool is_alive();
  /// Whether the process has a device. Then its limit of memory counts what it can write and shares with nobody, in
  /// place of its address space (Confinement::has_device).
  void set_device(bool has_device) { has_device_ = has_device; }
  /// Sets the most memory that the process may have, in bytes.
  void limit_memory(std::int64_t bytes) const;
  /// Waits for the end of the process, which has closed its socket, and throws ProcessLost.
  [[noreturn]] void fail_ended();

 private:
  pid_t id_ = -1;
  int status_ = 0;  ///< How it ended, once id_ is −1.
  bool has_device_ = false;
  std::unique_ptr<Channel> channel_;
};

/// A descriptor that is closed in time.
struct Descriptor {
  int number = -1;
  explicit Descriptor(int opened) : number(opened) {}
  ~Descriptor();
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
};

/// Processes for jobs. One is kept ready, because starting a program takes longer than a small job. Thread-safe.
class Workers {
 public:
  /// Opens the program at once: another version that is installed later does not speak as this server does.
  explicit Workers(const std::string& program);
  /// Returns a process that waits for its first message. Throws ProcessLost.
  std::unique_ptr<WorkerProcess> take();
  /// Keeps one ready, if none is.
  void prepare();

 private:
  const Descriptor opened_;
  const std::string program_;  ///< The path of what is open.
  std::mutex mutex_;
  std::unique_ptr<WorkerProcess> ready_;
};

/// Opens the blob's bytes as a file through which they can only be read. −1, with errno, if that fails.
int open_read_only(const Blob& blob);
/// Returns a file without a name that has these bytes and can neither be changed nor cut, in memory. −1, with errno, if
/// that fails.
int sealed_copy(std::string_view bytes);

}  // namespace varimesh::server
