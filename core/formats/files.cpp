// Mesh files on disk: reading maps them into memory, and writing uses OutputFile.
#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "core/base/io/output_file.h"
#include "core/formats/formats.h"

namespace varimesh::formats {

namespace {

std::string reason() { return std::system_category().message(errno); }

// Closes a file descriptor at the end of its scope.
struct Descriptor {
  int number = -1;
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  explicit Descriptor(int number) : number(number) {}
  ~Descriptor() {
    if (number >= 0) ::close(number);
  }
};

// Reads a file that cannot be mapped, such as a pipe, to its end.
Expected<MeshFile> read_stream(int descriptor, int threads) {
  std::string bytes;
  char piece[1 << 16];
  for (;;) {
    const ssize_t n = ::read(descriptor, piece, sizeof piece);
    if (n == 0) return read(bytes, threads);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return bad_input("Reading failed at byte " + std::to_string(bytes.size()) + ": " + reason() + ".");
    bytes.append(piece, std::size_t(n));
  }
}

/// Rounded up.
std::string mebibytes(std::int64_t bytes) { return std::to_string(((bytes - 1) >> 20) + 1) + " MiB"; }

}  // namespace

Expected<void> check_memory(std::int64_t file_bytes, std::int64_t memory) {
  if (memory == 0 || least_memory(file_bytes) <= memory) return {};
  return bad_input("The file has " + mebibytes(file_bytes) + ". Its mesh takes at least " +
                   mebibytes(least_memory(file_bytes)) + " of memory, but only " + mebibytes(memory) +
                   " may be used; use a machine with more memory, or a smaller mesh.");
}

Expected<MeshFile> read_file(const std::string& path, std::int64_t memory, int threads) {
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (file.number < 0) return bad_input("'" + path + "' cannot be opened: " + reason() + ".");
  struct stat status {};
  if (::fstat(file.number, &status) != 0) return bad_input("'" + path + "' cannot be read: " + reason() + ".");
  if (S_ISDIR(status.st_mode)) return bad_input("'" + path + "' is a folder; name a mesh file in it.");
  if (const auto fits = check_memory(S_ISREG(status.st_mode) ? status.st_size : 0, memory); !fits)
    return bad_input("'" + path + "': " + fits.error().sentence);
  Expected<MeshFile> result;
  const auto size = std::size_t(status.st_size);
  void* mapped =
      S_ISREG(status.st_mode) && size > 0 ? ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.number, 0) : MAP_FAILED;
  if (mapped == MAP_FAILED) {
    result = read_stream(file.number, threads);
  } else {
    (void)::madvise(mapped, size, MADV_SEQUENTIAL);
    result = read({static_cast<const char*>(mapped), size}, threads);
    ::munmap(mapped, size);
  }
  if (!result) result.error().sentence = "'" + path + "': " + result.error().sentence;
  return result;
}

Expected<void> write_file(const HighOrderMesh& mesh, Format format, const std::string& path,
                          std::span<const CellField> fields, int threads) {
  auto file = OutputFile::open(path);
  if (!file) return tl::unexpected(file.error());
  Expected<void> written = write(
      mesh, format, [&](std::string_view bytes) { return file->write(bytes); }, fields, threads);
  if (!written && !file->failed()) return written;
  return file->commit();
}

Expected<void> check_writable(const std::string& path) { return OutputFile::check(path); }

}  // namespace varimesh::formats
