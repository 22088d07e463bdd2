#include "server/isolation/worker_process.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <system_error>
#include <utility>

#include "core/base/write_all.h"
#include "core/process/helper_program.h"
#include "server/isolation/descriptors_of_worker.h"

namespace varimesh::server {
namespace {

/// A descriptor that is closed in time.
struct Descriptor {
  int number = -1;
  ~Descriptor() {
    if (number >= 0) ::close(number);
  }
};

[[noreturn]] void fail(const char* what) {
  throw ProcessLost{std::string(what) + " (" + std::system_category().message(errno) + ")"};
}

/// Returns a file without a name that has these bytes and can neither be changed nor cut, in memory.
int sealed_copy(std::string_view bytes) {
  const int file = ::memfd_create("varimesh", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (file < 0) return -1;
  if (write_all(file, bytes) && ::fcntl(file, F_ADD_SEALS, F_SEAL_WRITE | F_SEAL_SHRINK | F_SEAL_GROW) == 0)
    return file;
  const int reason = errno;
  ::close(file);
  errno = reason;
  return -1;
}

/// Returns a descriptor of the blob's bytes, through which they can only be read. A large mesh is in a file already,
/// and would take too much memory in another.
int read_only(const Blob& blob) {
  if (blob.file() < 0) return sealed_copy(blob.bytes());
  return ::open(("/proc/self/fd/" + std::to_string(blob.file())).c_str(), O_RDONLY | O_CLOEXEC);
}

std::string end_of(int status) {
  if (!WIFSIGNALED(status)) return "ended by itself with status " + std::to_string(WEXITSTATUS(status));
  const int signal = WTERMSIG(status);
  if (signal == SIGKILL) return "was killed, perhaps because the machine has no memory left";
  if (signal == SIGXCPU) return "used more processor time than its time limit allows";
  return "crashed (signal " + std::to_string(signal) + ")";
}

}  // namespace

WorkerProcess::WorkerProcess(const std::string& program, const Blob& mesh, std::string_view checkpoint) {
  constexpr const char* kNotStarted = "could not be started";
  Descriptor files[] = {{-1}, {read_only(mesh)}, {sealed_copy(checkpoint)}};
  int ends[2] = {-1, -1};
  if (files[1].number < 0 || files[2].number < 0 || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    fail(kNotStarted);
  files[0].number = ends[1];
  channel_ = std::make_unique<Channel>(ends[0]);
  constexpr int kSecondsToTake = 10;
  channel_->limit_sending(kSecondsToTake);
  static_assert(kWorkerSocket == 3 && kWorkerMesh == 4 && kWorkerCheckpoint == 5);
  const int numbers[] = {files[0].number, files[1].number, files[2].number};
  const Helper helper = start_helper({program, {}, numbers});
  id_ = helper.id;
  errno = helper.error;
  if (id_ < 0) fail(kNotStarted);
}

WorkerProcess::~WorkerProcess() {
  if (id_ > 0) end_helper(id_, true);
}

void WorkerProcess::limit_memory(std::int64_t bytes) const {
  rlimit limits{};
  if (::prlimit(id_, RLIMIT_AS, nullptr, &limits) != 0) return;
  limits.rlim_cur = std::min(static_cast<rlim_t>(bytes), limits.rlim_max);
  ::prlimit(id_, RLIMIT_AS, &limits, nullptr);
}

void WorkerProcess::fail_ended() {
  // Its socket is closed, so it has ended, or it is up to no good and does not end by itself.
  int status = 0;
  for (int waits = 0; waits < 100; ++waits) {
    const pid_t ended = ::waitpid(id_, &status, WNOHANG);
    if (ended == id_) {
      id_ = -1;
      throw ProcessLost{end_of(status)};
    }
    ::usleep(10'000);
  }
  end_helper(std::exchange(id_, -1), true);
  throw ProcessLost{"stopped talking to the server"};
}

}  // namespace varimesh::server
