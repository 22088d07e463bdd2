#include "core/formats/hdf5/process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <system_error>
#include <utility>

#include "core/formats/hdf5/starter.h"
#include "core/process/helper_program.h"

namespace varimesh::formats {

namespace {

namespace fs = std::filesystem;
using hdf5::Answer;
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

namespace {

std::function<Hdf5Program(const Hdf5Start&, int)>& other_starter() {
  static std::function<Hdf5Program(const Hdf5Start&, int)> starter;
  return starter;
}

}  // namespace

void use_hdf5_starter(std::function<Hdf5Program(const Hdf5Start& start, int file)> starter) {
  other_starter() = std::move(starter);
}

std::string hdf5_program() { return other_starter() ? hdf5::kProgram : find_helper(hdf5::kProgram, "VARIMESH_HDF5"); }

Hdf5Program start_hdf5(const Hdf5Start& start, int file) {
  if (const auto& starter = other_starter()) return starter(start, file);
  const std::string program = hdf5_program();
  if (program.empty()) return {-1, -1, ENOENT};
  int ends[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return {-1, -1, errno};
  const int files[] = {ends[1], file};
  static_assert(hdf5::kSocket == 3 && hdf5::kFile == 4);
  const Helper helper = start_helper(
      {program, {start.writes ? "write" : "read", std::to_string(start.seconds), std::to_string(start.memory)}, files});
  ::close(ends[1]);
  if (helper.id < 0) ::close(std::exchange(ends[0], -1));
  return {ends[0], helper.id, helper.error};
}

Hdf5Process::Hdf5Process(std::string_view file, const StopToken* stop) : file_(file), stop_(stop) {
  const Scratch none;
  start(false, none, std::int64_t(file.size()));
  open();
}

Hdf5Process::Hdf5Process(const Scratch& file, std::int64_t file_bytes, const StopToken* stop) : stop_(stop) {
  start(true, file, file_bytes);
  open();
}

void Hdf5Process::open() {
  try {
    const auto size = std::int64_t(file_.size());
    send({reinterpret_cast<const char*>(&size), sizeof size});
    answer(0);
  } catch (...) {
    end();  // of an object that is not made, no destructor is called
    throw;
  }
}

void Hdf5Process::start(bool writes, const Scratch& file, std::int64_t file_bytes) {
  const std::string program = hdf5_program();
  if (program.empty())
    throw Hdf5Failure{
        "VariMesh was installed without HDF5: varimesh_hdf5 is neither beside the program nor named by "
        "VARIMESH_HDF5; build VariMesh with the packages of the group 'hdf5' of deploy/packages",
        true};
  if (file.descriptor() < 0) throw Hdf5Failure{"no process can be started for HDF5 (" + reason(errno) + ")"};
  seconds_ = 60 + file_bytes / 10'000'000;
  const std::int64_t memory = (std::int64_t(1) << 29) + file_bytes;
  const Hdf5Program started = start_hdf5({writes, seconds_, memory}, file.descriptor());
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
  for (;;) {
    receive(reinterpret_cast<char*>(&head), sizeof head);
    if (head.what != Answer::Need) break;
    look(stop_);
    const auto size = std::int64_t(file_.size());
    if (head.first < 0 || head.bytes < 0 || head.first > size || head.bytes > size - head.first)
      throw Hdf5Failure{"HDF5 needs bytes behind the end of the file, so the file is probably damaged"};
    send(file_.substr(std::size_t(head.first), std::size_t(head.bytes)));
  }
  constexpr std::int64_t kMostReason = 1 << 12;
  if (head.bytes < 0 || head.bytes > (head.what == Answer::Failure ? kMostReason : most))
    throw Hdf5Failure{"HDF5 gave an answer of the wrong size, so the file is probably damaged"};
  if (head.what != Answer::Failure) return head.bytes;
  std::string why(std::size_t(head.bytes), '\0');
  receive(why.data(), why.size());
  std::replace_if(
      why.begin(), why.end(), [](unsigned char c) { return c < ' '; }, '?');
  throw Hdf5Failure{why};
}

std::string Hdf5Process::ask(Request request, std::string_view text, std::string_view values, std::int64_t first,
                             std::int64_t count, const std::function<void(std::int64_t bytes)>& before) {
  const RequestHead head{request, std::uint32_t(text.size()), first, count, std::int64_t(values.size())};
  send({reinterpret_cast<const char*>(&head), sizeof head});
  send(text);
  send(values);
  const std::int64_t size = answer(kMostList);
  before(size);
  std::string bytes(std::size_t(size), '\0');
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
