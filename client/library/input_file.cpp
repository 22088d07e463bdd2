#include "client/library/input_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "client/client.h"
#include "client/library/failures.h"
#include "core/base/io/write_all.h"

namespace varimesh::client {
namespace {

constexpr std::size_t kPieceBytes = 256 * 1024;

tl::unexpected<Failure> unreadable(const std::string& name, const std::string& why) {
  return file_failure("The file '" + name + "' cannot be read (" + why +
                      "); check its name, its permissions and its disk.");
}

tl::unexpected<Failure> unreadable(const std::string& name, int error) {
  return unreadable(name, std::system_category().message(error));
}

/// Reads a pipe, a device or a file without a size to its end into `copy`.
Outcome<void> read_stream(int stream, const std::string& name, const std::function<bool()>& interrupted,
                          InputFile* copy) {
  std::string piece;
  std::int64_t copied = 0;
  while (true) {
    if (interrupted && interrupted()) return interruption("Interrupted while '" + name + "' was being read.");
    pollfd ready{stream, POLLIN, 0};
    if (::poll(&ready, 1, 100) == 0) continue;
    piece.resize(kPieceBytes);
    const ssize_t count = ::read(stream, piece.data(), piece.size());
    if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
    if (count < 0)
      return unreadable(name, std::system_category().message(errno) + ", after " + std::to_string(copied) + " bytes");
    if (count == 0) return {};
    piece.resize(static_cast<std::size_t>(count));
    if (!copy->append(piece))
      return unreadable(name, "it is a stream, and copying it to the folder for temporary files failed after " +
                                  std::to_string(copied) + " bytes: " + std::system_category().message(errno));
    copied += count;
  }
}

}  // namespace

Outcome<InputFile> InputFile::open(const std::string& path, const std::function<bool()>& interrupted) {
  // Without O_NONBLOCK, opening a pipe would wait for a writer. read_stream() waits for one and can be interrupted.
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (descriptor < 0) return unreadable(path, errno);
  InputFile file(path, descriptor);
  struct stat status {};
  if (::fstat(descriptor, &status) != 0) return unreadable(path, errno);
  if (S_ISDIR(status.st_mode)) return unreadable(path, EISDIR);
  // Files that the kernel makes up, such as the ones in /proc, have no size before they are read.
  if (S_ISREG(status.st_mode) && status.st_size > 0) {
    file.opened_ = file.version();
    return file;
  }
  auto copy = temporary(path);
  if (!copy) return copy;
  if (const auto done = read_stream(descriptor, path, interrupted, &*copy); !done) return tl::unexpected(done.error());
  return copy;
}

Outcome<InputFile> InputFile::temporary(const std::string& name) {
  std::error_code error;
  std::string path = std::filesystem::temp_directory_path(error) / "varimesh-XXXXXX";
  const int descriptor = error ? -1 : ::mkostemp(path.data(), O_CLOEXEC);
  if (descriptor < 0)
    return file_failure("No temporary file can be made (" +
                        (error ? error.message() : std::system_category().message(errno)) +
                        "); set TMPDIR to a folder where files can be made.");
  ::unlink(path.c_str());
  return InputFile(name, descriptor);
}

InputFile::InputFile(InputFile&& other) noexcept
    : name_(std::move(other.name_)), descriptor_(std::exchange(other.descriptor_, -1)), opened_(other.opened_) {}

InputFile::~InputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Outcome<InputFile> InputFile::again() const {
  const int descriptor = ::fcntl(descriptor_, F_DUPFD_CLOEXEC, 0);
  if (descriptor < 0) return unreadable(name_, errno);
  InputFile file(name_, descriptor);
  file.opened_ = opened_;
  return file;
}

std::optional<InputFile::Version> InputFile::version() const {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) return std::nullopt;
  return Version{status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec};
}

bool InputFile::has_changed() const { return opened_ && opened_ != version(); }

Outcome<std::string> InputFile::read_all() const {
  const std::optional<Version> now = version();
  if (!now) return unreadable(name_, errno);
  return read(0, static_cast<std::size_t>(now->size));
}

Outcome<std::string> InputFile::read(std::int64_t offset, std::size_t most) const {
  std::string bytes;
  if (auto done = read(offset, most, bytes); !done) return tl::unexpected(std::move(done.error()));
  return bytes;
}

Outcome<void> InputFile::read(std::int64_t offset, std::size_t most, std::string& bytes) const {
  bytes.resize(most);
  std::size_t filled = 0;
  while (filled < most) {
    const ssize_t count = ::pread(descriptor_, bytes.data() + filled, most - filled,
                                  static_cast<off_t>(offset) + static_cast<off_t>(filled));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0)
      return unreadable(name_, std::system_category().message(errno) + ", at byte " +
                                   std::to_string(offset + static_cast<std::int64_t>(filled)));
    if (count == 0) break;
    filled += static_cast<std::size_t>(count);
  }
  bytes.resize(filled);
  return {};
}

bool InputFile::append(std::string_view bytes) { return write_all(descriptor_, bytes); }

Outcome<std::string> read_whole(const std::string& path, const std::function<bool()>& interrupted) {
  const auto file = InputFile::open(path, interrupted);
  if (!file) return tl::unexpected(file.error());
  std::string text;
  while (true) {
    const auto piece = file->read(static_cast<std::int64_t>(text.size()), kPieceBytes);
    if (!piece || piece->empty()) return piece ? Outcome<std::string>(std::move(text)) : piece;
    text += *piece;
  }
}

}  // namespace varimesh::client
