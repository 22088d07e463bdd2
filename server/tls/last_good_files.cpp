// Files without names, which gRPC opens through the descriptors of this process.
#include "server/tls/last_good_files.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <utility>

#include "core/base/io/write_all.h"

namespace varimesh::server {
namespace {

constexpr std::chrono::minutes kCheckEvery{1};
constexpr std::size_t kMostBytes = std::size_t{1} << 20;

void close_all(const auto& descriptors) {
  for (const int file : descriptors)
    if (file >= 0) ::close(file);
}

/// The path through which this process opens what is open as `file`; empty if nothing is.
std::string path_of(int file) { return file < 0 ? "" : "/proc/self/fd/" + std::to_string(file); }

std::array<std::string, 3> names_of(const TlsFiles& files) { return {files.certificate, files.key, files.authority}; }

TlsFiles paths_of(const std::array<int, 3>& files) { return {path_of(files[0]), path_of(files[1]), path_of(files[2])}; }

/// Returns a file in memory with the bytes of a file of less than kMostBytes. −1, with errno, if that fails.
int copy_of(const std::string& name) {
  std::ifstream file(name, std::ios::binary);
  std::string bytes(kMostBytes, '\0');
  if (file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) errno = EFBIG;
  if (!file.eof()) return -1;
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  const int copy = ::memfd_create("varimesh-tls", MFD_CLOEXEC);
  if (copy < 0 || write_all(copy, bytes)) return copy;
  const int reason = errno;
  ::close(copy);
  errno = reason;
  return -1;
}

}  // namespace

Expected<std::unique_ptr<LastGoodFiles>> LastGoodFiles::of(const TlsFiles& files) {
  std::unique_ptr<LastGoodFiles> made(new LastGoodFiles(files));
  made->seen_ = made->version();
  made->checked_ = std::chrono::steady_clock::now();
  const auto copied = made->copy();
  if (!copied) return tl::unexpected(copied.error());
  made->copied_ = *copied;
  made->copies_ = paths_of(*copied);
  return made;
}

LastGoodFiles::~LastGoodFiles() { close_all(copied_); }

LastGoodFiles::Version LastGoodFiles::version() const {
  Version version{};
  std::size_t at = 0;
  for (const std::string& name : names_of(files_)) {
    struct stat status {};
    if (!name.empty() && ::stat(name.c_str(), &status) != 0) status = {};
    version[at++] = std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec;
    version[at++] = status.st_size;
    version[at++] = static_cast<std::int64_t>(status.st_ino);
  }
  return version;
}

Expected<LastGoodFiles::Descriptors> LastGoodFiles::copy() const {
  Descriptors copied;
  copied.fill(-1);
  const std::array<std::string, kFiles> names = names_of(files_);
  for (std::size_t i = 0; i < kFiles; ++i) {
    if (names[i].empty()) continue;
    copied[i] = copy_of(names[i]);
    if (copied[i] >= 0) continue;
    const std::string why = std::strerror(errno);
    close_all(copied);
    return bad_option("The file '" + names[i] + "' cannot be read: " + why + ".");
  }
  // What is checked is what is used, and not what the files are by then.
  const TlsFiles paths = paths_of(copied);
  if (const auto checked = check_tls_files(files_, &paths); !checked) {
    close_all(copied);
    return tl::unexpected(checked.error());
  }
  return copied;
}

Expected<bool> LastGoodFiles::refresh() {
  const Version now = version();
  const auto time = std::chrono::steady_clock::now();
  if (now == seen_ && time - checked_ < kCheckEvery) return false;
  const bool is_new = std::exchange(seen_, now) != now;
  checked_ = time;
  const auto copied = copy();
  if (!copied) return tl::unexpected(copied.error());
  // gRPC opens these numbers again and again, and looks at both files of a pair before and after it has read them.
  for (std::size_t i = 0; is_new && i < kFiles; ++i)
    if (copied_[i] >= 0) ::dup3((*copied)[i], copied_[i], O_CLOEXEC);
  close_all(*copied);
  return is_new;
}

}  // namespace varimesh::server
