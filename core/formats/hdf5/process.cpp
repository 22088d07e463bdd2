#include "core/formats/hdf5/process.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <system_error>
#include <utility>

#include "core/base/stopwatch.h"
#include "core/formats/hdf5/protocol.h"
#include "core/formats/hdf5/starter.h"
#include "core/process/helper_program.h"

namespace varimesh::formats {

namespace {

std::string reason(int error) { return std::system_category().message(error); }

std::function<Hdf5Program(const Hdf5Start&)>& other_starter() {
  static std::function<Hdf5Program(const Hdf5Start&)> starter;
  return starter;
}

}  // namespace

void use_hdf5_starter(std::function<Hdf5Program(const Hdf5Start& start)> starter) {
  other_starter() = std::move(starter);
}

std::string hdf5_program() { return other_starter() ? hdf5::kProgram : find_helper(hdf5::kProgram, "VARIMESH_HDF5"); }

Hdf5Program start_hdf5(const Hdf5Start& start) {
  if (const auto& starter = other_starter()) return starter(start);
  const std::string program = hdf5_program();
  if (program.empty()) return {-1, -1, ENOENT};
  int ends[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return {-1, -1, errno};
  const int files[] = {ends[1]};
  static_assert(hdf5::kSocket == 3);
  const Helper helper = start_helper(
      {program, {start.writes ? "write" : "read", std::to_string(start.seconds), std::to_string(start.memory)}, files});
  ::close(ends[1]);
  if (helper.id < 0) ::close(std::exchange(ends[0], -1));
  return {ends[0], helper.id, helper.error};
}

Hdf5Process::Hdf5Process(bool writes, std::int64_t bytes, std::int64_t memory, const StopToken* stop)
    : stop_(stop), seconds_(60 + bytes / 2'500'000) {
  const std::string program = hdf5_program();
  if (program.empty())
    throw Hdf5Failure{
        "VariMesh was installed without HDF5: varimesh_hdf5 is neither beside the program nor named by "
        "VARIMESH_HDF5; build VariMesh with the packages of the group 'hdf5' of deploy/packages",
        true};
  const Hdf5Program started = start_hdf5({writes, seconds_, memory});
  socket_ = started.socket;
  child_ = started.id;
  if (socket_ < 0)
    throw Hdf5Failure{"'" + program + "', which reads and writes HDF5 files, cannot be started (" +
                      reason(started.error) + ")"};
}

Hdf5Process::~Hdf5Process() { end(); }

void Hdf5Process::end() {
  if (socket_ >= 0) ::close(std::exchange(socket_, -1));
  if (child_ > 0) end_helper(std::exchange(child_, -1), true);
}

void Hdf5Process::fail_ended() {
  if (child_ < 0) throw Hdf5Failure{"HDF5 crashed, or took all its time or memory"};
  const int status = end_helper(std::exchange(child_, -1), false);
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL))
    throw Hdf5Failure{"HDF5 took more than " + std::to_string(seconds_) + " s or all memory"};
  if (WIFSIGNALED(status))
    throw Hdf5Failure{"HDF5 crashed (signal " + std::to_string(WTERMSIG(status)) +
                      "), so the file is probably damaged"};
  throw Hdf5Failure{"the program for HDF5 ended with status " + std::to_string(WEXITSTATUS(status))};
}

void Hdf5Process::wait(short events) {
  constexpr int kMilliseconds = 100;
  pollfd socket{socket_, events, 0};
  // A process that waits uses no processor time. On a busy machine it may take much longer than its processor time.
  while (waited_ < 10 * double(seconds_)) {
    look(stop_);
    const Stopwatch clock;
    const int ready = ::poll(&socket, 1, kMilliseconds);
    const int error = errno;
    waited_ += clock.seconds();
    if (ready > 0) return;
    if (ready < 0 && error != EINTR) throw Hdf5Failure{"waiting for HDF5 failed (" + reason(error) + ")"};
  }
  throw Hdf5Failure{"HDF5 gave no answer within " + std::to_string(10 * seconds_) + " s"};
}

void Hdf5Process::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n > 0) {
      bytes.remove_prefix(std::size_t(n));
    } else if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      wait(POLLOUT);
    } else if (n == 0 || errno != EINTR) {
      fail_ended();
    }
  }
}

std::size_t Hdf5Process::receive(std::span<char> to) {
  for (;;) {
    look(stop_);
    const ssize_t n = ::recv(socket_, to.data(), to.size(), MSG_DONTWAIT);
    if (n > 0) return std::size_t(n);
    if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK))
      wait(POLLIN);
    else if (n == 0 || errno != EINTR)
      fail_ended();
  }
}

}  // namespace varimesh::formats
