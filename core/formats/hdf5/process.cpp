#include "core/formats/hdf5/process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <system_error>

namespace varimesh::formats {

namespace {

namespace fs = std::filesystem;
using hdf5::AnswerHead;
using hdf5::Request;
using hdf5::RequestHead;

constexpr std::int64_t kMostList = std::int64_t(1) << 26;

std::string reason(int error) { return std::system_category().message(error); }

}  // namespace

// === The file ============================================================================================

Scratch::Scratch() {
  std::error_code none;
  const fs::path folder = fs::temp_directory_path(none);
  descriptor_ = none ? -1 : ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (descriptor_ < 0) descriptor_ = ::memfd_create("varimesh hdf5", MFD_CLOEXEC);
}

Scratch::~Scratch() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

// === The program =========================================================================================

std::string hdf5_program() {
  std::error_code none;
  if (const char* named = std::getenv("VARIMESH_HDF5"); named != nullptr && *named != '\0')
    return fs::is_regular_file(named, none) ? named : "";
  const fs::path own = fs::read_symlink("/proc/self/exe", none);
  if (own.empty()) return "";
  for (const fs::path& folder : {own.parent_path(), own.parent_path().parent_path() / "lib" / "varimesh"})
    if (fs::is_regular_file(folder / hdf5::kProgram, none)) return (folder / hdf5::kProgram).string();
  return "";
}

Hdf5Process::Hdf5Process(Mode mode, const Scratch& file, std::int64_t file_bytes, const StopToken* stop) : stop_(stop) {
  start(mode, file, file_bytes);
  try {
    answer(0);
  } catch (...) {
    end();  // of an object that is not made, no destructor is called
    throw;
  }
}

void Hdf5Process::start(Mode mode, const Scratch& file, std::int64_t file_bytes) {
  const std::string program = hdf5_program();
  if (program.empty())
    throw Hdf5Failure{
        "VariMesh was installed without HDF5: varimesh_hdf5 is neither beside the program nor named by "
        "VARIMESH_HDF5; build VariMesh with the packages of the group 'hdf5' of deploy/packages",
        true};
  int ends[2] = {-1, -1};
  if (file.descriptor() < 0 || ::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    throw Hdf5Failure{"no process can be started for HDF5 (" + reason(errno) + ")"};
  // Higher numbers first, so that neither takes the other's place.
  const int socket_copy = ::fcntl(ends[1], F_DUPFD_CLOEXEC, 16);
  const int file_copy = ::fcntl(file.descriptor(), F_DUPFD_CLOEXEC, 16);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&files, socket_copy, hdf5::kSocket);
  posix_spawn_file_actions_adddup2(&files, file_copy, hdf5::kFile);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none, defaults;
  sigemptyset(&none);
  sigfillset(&defaults);
  posix_spawnattr_setsigmask(&attributes, &none);
  posix_spawnattr_setsigdefault(&attributes, &defaults);
  // A group of its own: a Ctrl-C goes to this process only, which decides what becomes of its work.
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETPGROUP);
  seconds_ = 60 + file_bytes / 10'000'000;
  const std::int64_t memory = (std::int64_t(1) << 29) + file_bytes;
  std::string words[] = {program, mode == Mode::Read ? "read" : "write", std::to_string(seconds_),
                         std::to_string(memory)};
  char* arguments[] = {words[0].data(), words[1].data(), words[2].data(), words[3].data(), nullptr};
  const int error = posix_spawn(&child_, program.c_str(), &files, &attributes, arguments, environ);
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&files);
  for (const int copy : {socket_copy, file_copy, ends[1]})
    if (copy >= 0) ::close(copy);
  socket_ = ends[0];
  if (error != 0) {
    child_ = -1;
    ::close(std::exchange(socket_, -1));
    throw Hdf5Failure{"'" + program + "', which reads and writes HDF5 files, cannot be started (" + reason(error) +
                      ")"};
  }
}

Hdf5Process::~Hdf5Process() { end(); }

void Hdf5Process::end() {
  if (socket_ >= 0) ::close(std::exchange(socket_, -1));
  if (child_ <= 0) return;
  ::kill(child_, SIGKILL);
  while (::waitpid(child_, nullptr, 0) < 0 && errno == EINTR) {
  }
  child_ = -1;
}

void Hdf5Process::fail_ended() {
  int status = 0;
  while (::waitpid(child_, &status, 0) < 0 && errno == EINTR) {
  }
  child_ = -1;
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGXCPU || WTERMSIG(status) == SIGKILL))
    throw Hdf5Failure{"HDF5 took more than " + std::to_string(seconds_) + " s or all memory"};
  if (WIFSIGNALED(status))
    throw Hdf5Failure{"HDF5 crashed (signal " + std::to_string(WTERMSIG(status)) +
                      "), so the file is probably damaged"};
  throw Hdf5Failure{"the program for HDF5 ended with status " + std::to_string(WEXITSTATUS(status))};
}

// === Requests ============================================================================================

void Hdf5Process::wait(short events) {
  constexpr int kMilliseconds = 100;
  pollfd socket{socket_, events, 0};
  // A process that waits uses no processor time. On a busy machine it may take much longer than its processor time.
  for (std::int64_t left = 10 * seconds_ * 1000 / kMilliseconds; left > 0; --left) {
    look(stop_);
    const int ready = ::poll(&socket, 1, kMilliseconds);
    if (ready > 0) return;
    if (ready < 0 && errno != EINTR) throw Hdf5Failure{"waiting for HDF5 failed (" + reason(errno) + ")"};
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

void Hdf5Process::receive(char* to, std::size_t bytes) {
  while (bytes > 0) {
    const ssize_t n = ::recv(socket_, to, bytes, MSG_DONTWAIT);
    if (n > 0) {
      to += n;
      bytes -= std::size_t(n);
    } else if (n < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) {
      wait(POLLIN);
    } else if (n == 0 || errno != EINTR) {
      fail_ended();
    }
  }
}

std::int64_t Hdf5Process::answer(std::int64_t most) {
  AnswerHead head;
  receive(reinterpret_cast<char*>(&head), sizeof head);
  constexpr std::int64_t kMostReason = 1 << 12;
  if (head.bytes < 0 || head.bytes > (head.failed != 0 ? kMostReason : most))
    throw Hdf5Failure{"HDF5 gave an answer of the wrong size, so the file is probably damaged"};
  if (head.failed == 0) return head.bytes;
  std::string why(std::size_t(head.bytes), '\0');
  receive(why.data(), why.size());
  std::replace_if(
      why.begin(), why.end(), [](unsigned char c) { return c < ' '; }, '?');
  throw Hdf5Failure{why};
}

std::string Hdf5Process::ask(Request request, std::string_view text, std::string_view values, std::int64_t first,
                             std::int64_t count) {
  const RequestHead head{request, std::uint32_t(text.size()), first, count, std::int64_t(values.size())};
  send({reinterpret_cast<const char*>(&head), sizeof head});
  send(text);
  send(values);
  std::string bytes(std::size_t(answer(kMostList)), '\0');
  receive(bytes.data(), bytes.size());
  return bytes;
}

void Hdf5Process::ask(Request request, std::string_view text, std::int64_t first, std::int64_t count,
                      std::span<char> out) {
  const RequestHead head{request, std::uint32_t(text.size()), first, count, 0};
  send({reinterpret_cast<const char*>(&head), sizeof head});
  send(text);
  if (answer(std::int64_t(out.size())) != std::int64_t(out.size()))
    throw Hdf5Failure{"HDF5 gave an answer of the wrong size, so the file is probably damaged"};
  receive(out.data(), out.size());
}

}  // namespace varimesh::formats
