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

#include "core/base/io/write_all.h"
#include "core/process/helper_program.h"
#include "server/isolation/socket_of_worker.h"

namespace varimesh::server {
namespace {

[[noreturn]] void fail(const char* what) {
  throw ProcessLost{std::string(what) + " (" + std::system_category().message(errno) + ")"};
}

std::string end_of(int status) {
  if (!WIFSIGNALED(status)) return "ended by itself with status " + std::to_string(WEXITSTATUS(status));
  const int signal = WTERMSIG(status);
  if (signal == SIGKILL) return "was killed, perhaps because the machine has no memory left";
  if (signal == SIGXCPU) return "used more processor time than its time limit allows";
  return "crashed (signal " + std::to_string(signal) + ")";
}

/// Opens a program, as a number that the descriptors of the process that is started do not take. −1 if that fails.
int open_high(const std::string& program) {
  const Descriptor opened(::open(program.c_str(), O_PATH | O_CLOEXEC));
  return opened.number < 0 ? -1 : ::fcntl(opened.number, F_DUPFD_CLOEXEC, 16);
}

}  // namespace

Descriptor::~Descriptor() {
  if (number >= 0) ::close(number);
}

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

int open_read_only(const Blob& blob) {
  // A large mesh is in a file already, and would take too much memory in another.
  if (blob.file() < 0) return sealed_copy(blob.bytes());
  return ::open(("/proc/self/fd/" + std::to_string(blob.file())).c_str(), O_RDONLY | O_CLOEXEC);
}

WorkerProcess::WorkerProcess(const std::string& program) {
  int ends[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) fail("could not be started");
  channel_ = std::make_unique<Channel>(ends[0]);
  constexpr int kSecondsToTake = 10;
  channel_->limit_sending(kSecondsToTake);
  const Descriptor other(ends[1]);
  const int files[] = {other.number};
  static_assert(kWorkerSocket == 3);
  const Helper helper = start_helper({program, {}, files});
  id_ = helper.id;
  errno = helper.error;
  if (id_ < 0) fail("could not be started");
}

WorkerProcess::~WorkerProcess() {
  if (id_ > 0) end_helper(id_, true);
}

void WorkerProcess::limit_memory(std::int64_t bytes) const {
  rlimit limits{};
  const auto kind = has_device_ ? RLIMIT_DATA : RLIMIT_AS;
  if (::prlimit(id_, kind, nullptr, &limits) != 0) return;
  limits.rlim_cur = std::min(static_cast<rlim_t>(bytes), limits.rlim_max);
  ::prlimit(id_, kind, &limits, nullptr);
}

bool WorkerProcess::is_alive() {
  if (id_ > 0 && ::waitpid(id_, &status_, WNOHANG) == id_) id_ = -1;
  return id_ > 0;
}

void WorkerProcess::fail_ended() {
  // Its socket is closed, so it has ended, or it is up to no good and does not end by itself.
  for (int waits = 0; waits < 100 && is_alive(); ++waits) ::usleep(10'000);
  if (!is_alive()) throw ProcessLost{end_of(status_)};
  end_helper(std::exchange(id_, -1), true);
  throw ProcessLost{"stopped talking to the server"};
}

Workers::Workers(const std::string& program)
    : opened_(open_high(program)),
      program_(opened_.number < 0 ? program : "/proc/self/fd/" + std::to_string(opened_.number)) {}

std::unique_ptr<WorkerProcess> Workers::take() {
  {
    const std::scoped_lock lock(mutex_);
    if (ready_ != nullptr && ready_->is_alive()) return std::move(ready_);
  }
  return std::make_unique<WorkerProcess>(program_);
}

void Workers::prepare() {
  const std::scoped_lock lock(mutex_);
  if (ready_ != nullptr && ready_->is_alive()) return;
  try {
    ready_ = std::make_unique<WorkerProcess>(program_);
  } catch (const ProcessLost&) {
    ready_.reset();  // the next job will say why
  }
}

}  // namespace varimesh::server
