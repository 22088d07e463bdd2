// Files on disk: mapped for reading, written beside and renamed.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <system_error>

#include "core/formats/formats.h"

namespace varimesh::formats {

namespace {

std::string reason() { return std::system_category().message(errno); }

tl::unexpected<Error> bad_output(std::string sentence) {
  return tl::unexpected<Error>({Error::Kind::Output, std::move(sentence)});
}

// A descriptor that closes itself.
struct Descriptor {
  int number = -1;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  explicit Descriptor(int number) : number(number) {}
  ~Descriptor() {
    if (number >= 0) ::close(number);
  }
};

// What cannot be mapped (a pipe, a special file) is read to its end.
Expected<MeshFile> read_stream(int descriptor, const std::string& path) {
  std::string bytes;
  char piece[1 << 16];
  for (;;) {
    const ssize_t n = ::read(descriptor, piece, sizeof piece);
    if (n == 0) return read(bytes);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return bad_input("'" + path + "' cannot be read: " + reason() + ".");
    bytes.append(piece, std::size_t(n));
  }
}

std::string folder_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? "." : slash == 0 ? "/" : path.substr(0, slash);
}

// Opens a new file beside `path`, under a name that nobody else uses. Not mkstemp, whose files are for their owner
// alone: the result is to have the rights that any new file gets, or those of the file that it replaces.
int open_beside(const std::string& path, std::string& beside) {
  static std::atomic<unsigned> serial{0};
  for (int attempt = 0; attempt < 100; ++attempt) {
    beside = path + ".part-" + std::to_string(::getpid()) + "-" + std::to_string(++serial);
    const int descriptor = ::open(beside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor < 0 && errno == EEXIST) continue;
    struct stat old {};
    if (descriptor >= 0 && ::stat(path.c_str(), &old) == 0 && ::fchmod(descriptor, old.st_mode & 0777) != 0) errno = 0;
    return descriptor;
  }
  return -1;
}

bool write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t n = ::write(descriptor, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    bytes.remove_prefix(std::size_t(n));
  }
  return true;
}

}  // namespace

Expected<MeshFile> read_file(const std::string& path) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.number < 0) return bad_input("'" + path + "' cannot be opened: " + reason() + ".");
  struct stat status {};
  if (::fstat(file.number, &status) != 0) return bad_input("'" + path + "' cannot be read: " + reason() + ".");
  if (S_ISDIR(status.st_mode)) return bad_input("'" + path + "' is a folder; name a mesh file in it.");
  Expected<MeshFile> result;
  const auto size = std::size_t(status.st_size);
  void* mapped =
      S_ISREG(status.st_mode) && size > 0 ? ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.number, 0) : MAP_FAILED;
  if (mapped == MAP_FAILED) {
    result = read_stream(file.number, path);
  } else {
    (void)::madvise(mapped, size, MADV_SEQUENTIAL);
    result = read({static_cast<const char*>(mapped), size});
    ::munmap(mapped, size);
  }
  if (!result) result.error().sentence = "'" + path + "': " + result.error().sentence;
  return result;
}

Expected<void> write_file(const HighOrderMesh& mesh, Format format, const std::string& path,
                          std::span<const CellField> fields) {
  std::string beside;
  const Descriptor file(open_beside(path, beside));
  if (file.number < 0) return bad_output("'" + path + "' cannot be written: " + reason() + ".");
  int error = 0;
  Expected<void> result = write(
      mesh, format,
      [&](std::string_view bytes) {
        if (write_all(file.number, bytes)) return true;
        error = errno;
        return false;
      },
      fields);
  if (result) {
    // Renaming before the bytes are on the disk could leave an empty file under the name after a power cut.
    if (::fsync(file.number) != 0 && errno != EINVAL && errno != EROFS) error = errno;
    if (error == 0 && ::rename(beside.c_str(), path.c_str()) == 0) return result;
    if (error == 0) error = errno;
    result = bad_output("");
  }
  ::unlink(beside.c_str());
  if (error != 0) return bad_output("'" + path + "' cannot be written: " + std::system_category().message(error) + ".");
  return result;
}

Expected<void> check_writable(const std::string& path) {
  struct stat status {};
  if (path.empty()) return bad_output("The output's name is empty.");
  if (::stat(path.c_str(), &status) == 0 && S_ISDIR(status.st_mode))
    return bad_output("'" + path + "' is a folder; name a file in it.");
  if (::stat(folder_of(path).c_str(), &status) != 0)
    return bad_output("'" + path + "' cannot be written: its folder '" + folder_of(path) + "' does not exist.");
  std::string beside;
  const Descriptor file(open_beside(path, beside));
  if (file.number < 0) return bad_output("'" + path + "' cannot be written: " + reason() + ".");
  ::unlink(beside.c_str());
  return {};
}

}  // namespace varimesh::formats
