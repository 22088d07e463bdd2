// Finds the file or device to which a name leads, and writes there.
#include "core/base/io/output_file.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <mutex>
#include <set>
#include <system_error>
#include <vector>

#include "core/base/io/write_all.h"

namespace varimesh {

namespace {

namespace fs = std::filesystem;

tl::unexpected<Error> bad_output(std::string sentence) {
  return tl::unexpected<Error>({Error::Kind::Output, std::move(sentence)});
}

tl::unexpected<Error> not_written(const std::string& path, int error) {
  return bad_output("'" + path + "' cannot be written: " + std::system_category().message(error) + ".");
}

// ===== Unfinished files =====

struct Unfinished {
  std::mutex mutex;
  std::set<std::string> files;
};

// Never destroyed: the thread that ends the process may still need it.
Unfinished& unfinished() {
  static auto* const all = new Unfinished;
  return *all;
}

// ===== The target of a name =====

struct Target {
  enum class Kind { File, Special, Descriptor };
  Kind kind = Kind::File;
  std::string path;     // of the file itself, after all links
  int descriptor = -1;  // of this process
  bool exists = false;
  struct stat status {};
};

// The descriptor of this process to which a link such as /dev/stdout finally leads, or -1.
int own_descriptor(const fs::path& link) {
  std::error_code none;
  const fs::path folder = fs::canonical(link.parent_path().empty() ? "." : link.parent_path(), none);
  if (none || folder != fs::canonical("/proc/self/fd", none) || none) return -1;
  const std::string name = link.filename();
  int number = -1;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), number);
  return error == std::errc{} && end == name.data() + name.size() ? number : -1;
}

// Follows links one by one, because the last one may lead to a file that does not exist yet.
Expected<Target> find_target(const std::string& path) {
  if (path.empty()) return bad_output("The name of the output file is empty; give a name.");
  Target target;
  fs::path at = path;
  for (int hops = 0; ::lstat(at.c_str(), &target.status) == 0 && S_ISLNK(target.status.st_mode); ++hops) {
    if (hops == 40) return not_written(path, ELOOP);
    target.descriptor = own_descriptor(at);
    if (target.descriptor >= 0) {
      target.kind = Target::Kind::Descriptor;
      return target;
    }
    std::error_code error;
    const fs::path next = fs::read_symlink(at, error);
    if (error) return not_written(path, error.value());
    // A pipe of another process has a name that cannot be opened, such as "pipe:[123]". The link itself can be opened.
    if (next.string().find(":[") != std::string::npos && ::stat(at.c_str(), &target.status) == 0) break;
    at = at.parent_path() / next;
  }
  target.path = at;
  target.exists = ::stat(at.c_str(), &target.status) == 0;
  if (target.exists && S_ISDIR(target.status.st_mode))
    return bad_output("'" + path + "' is a folder; name a file in it.");
  if (target.exists && S_ISSOCK(target.status.st_mode))
    return bad_output("'" + path + "' is a socket, to which no file can be written; name a file.");
  if (target.exists && !S_ISREG(target.status.st_mode)) target.kind = Target::Kind::Special;
  return target;
}

std::string folder_of(const std::string& path) {
  const std::string folder = fs::path(path).parent_path();
  return folder.empty() ? "." : folder;
}

Expected<void> may_write(const std::string& path, const Target& target) {
  if (target.kind == Target::Kind::Descriptor) {
    const int flags = ::fcntl(target.descriptor, F_GETFL);
    if (flags < 0) return not_written(path, errno);
    if ((flags & O_ACCMODE) == O_RDONLY) return not_written(path, EBADF);
    return {};
  }
  if (target.exists && ::faccessat(AT_FDCWD, target.path.c_str(), W_OK, AT_EACCESS) != 0)
    return not_written(path, errno);
  struct stat status {};
  if (!target.exists && ::stat(folder_of(target.path).c_str(), &status) != 0)
    return bad_output("'" + path + "' cannot be written: its folder '" + folder_of(target.path) + "' does not exist.");
  return {};
}

// ===== Opening =====

// Gives a new file the owner, the group and the permissions of the file that it will replace.
void keep_rights(int descriptor, const struct stat& old) {
  mode_t rights = old.st_mode & 0777;
  // If this process may not change the owner, it only changes the group. If it may not change the group either, the new
  // file gives its group no permissions, because it is not the group that had them.
  const bool grouped = ::fchown(descriptor, old.st_uid, old.st_gid) == 0 ||
                       ::fchown(descriptor, static_cast<uid_t>(-1), old.st_gid) == 0;
  if (!grouped) rights &= ~mode_t{070};
  if (::fchmod(descriptor, rights) != 0) errno = 0;
}

// Opens a new file in the folder of the target, under a name that is not in use. mkstemp would make a file that only
// its owner can read. This file has the permissions of any new file, or those of the file that it will replace.
int open_beside(const Target& target, std::string* beside) {
  static std::atomic<unsigned> serial{0};
  // Cut, so that a long name leaves room for the ending.
  const std::string name = fs::path(target.path).filename().string().substr(0, 200);
  Unfinished& all = unfinished();
  const std::lock_guard lock(all.mutex);
  for (int attempt = 0; attempt < 100; ++attempt) {
    *beside = fs::path(target.path).parent_path() /
              (name + ".part-" + std::to_string(::getpid()) + "-" + std::to_string(++serial));
    const int descriptor = ::open(beside->c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor < 0 && errno == EEXIST) continue;
    if (descriptor < 0) return -1;
    all.files.insert(*beside);
    if (target.exists) {
      keep_rights(descriptor, target.status);
    }
    return descriptor;
  }
  return -1;
}

// Brings the new name to the disk. Ignores folders that cannot be opened or synchronised. Returns errno, or 0.
int sync_folder_of(const std::string& path) {
  const int folder = ::open(folder_of(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) return 0;
  const int error = ::fsync(folder) == 0 ? 0 : errno;
  ::close(folder);
  return error == EINVAL || error == EROFS ? 0 : error;
}

// Overwrites one file with the bytes of another and brings them to the disk. Returns errno, or 0.
int copy_over(const std::string& from, const std::string& to) {
  const int source = ::open(from.c_str(), O_RDONLY | O_CLOEXEC);
  if (source < 0) return errno;
  const int target = ::open(to.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC);
  int error = target < 0 ? errno : 0;
  std::vector<char> buffer(std::size_t{1} << 16);
  while (error == 0) {
    const ssize_t count = ::read(source, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) error = errno;
    if (count <= 0) break;
    if (!write_all(target, {buffer.data(), static_cast<std::size_t>(count)})) error = errno;
  }
  if (error == 0 && ::fsync(target) != 0 && errno != EINVAL && errno != EROFS) error = errno;
  if (target >= 0 && ::close(target) != 0 && error == 0) error = errno;
  ::close(source);
  return error;
}

void remove_unfinished(const std::string& beside) {
  Unfinished& all = unfinished();
  const std::lock_guard lock(all.mutex);
  if (all.files.erase(beside) > 0) ::unlink(beside.c_str());
}

}  // namespace

// ===== The class =====

Expected<OutputFile> OutputFile::open(const std::string& path) {
  const auto target = find_target(path);
  if (!target) return tl::unexpected(target.error());
  if (const auto may = may_write(path, *target); !may) return tl::unexpected(may.error());
  std::string beside;
  int descriptor = -1;
  switch (target->kind) {
    case Target::Kind::Descriptor:
      descriptor = ::fcntl(target->descriptor, F_DUPFD_CLOEXEC, 3);
      break;
    case Target::Kind::Special:
      descriptor = ::open(target->path.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
      break;
    case Target::Kind::File:
      descriptor = open_beside(*target, &beside);
      break;
  }
  if (descriptor < 0) return not_written(path, errno);
  return OutputFile(path, target->path, std::move(beside), descriptor);
}

Expected<void> OutputFile::check(const std::string& path) {
  const auto target = find_target(path);
  if (!target) return tl::unexpected(target.error());
  if (auto may = may_write(path, *target); !may) return may;
  // A pipe is not opened: closing it again would tell its reader that the output has ended.
  if (target->kind != Target::Kind::File) return {};
  std::string beside;
  const int descriptor = open_beside(*target, &beside);
  if (descriptor < 0) return not_written(path, errno);
  ::close(descriptor);
  remove_unfinished(beside);
  return {};
}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      target_(std::move(other.target_)),
      beside_(std::exchange(other.beside_, {})),
      descriptor_(std::exchange(other.descriptor_, -1)),
      error_(other.error_) {}

OutputFile::~OutputFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (!beside_.empty()) remove_unfinished(beside_);
}

bool OutputFile::write(std::string_view bytes) {
  while (error_ == 0 && !bytes.empty()) {
    const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0 && errno == EAGAIN) {
      // A pipe that the process which opened it made non-blocking.
      pollfd ready{descriptor_, POLLOUT, 0};
      ::poll(&ready, 1, -1);
      continue;
    }
    if (written <= 0)
      error_ = written < 0 ? errno : EIO;
    else
      bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return error_ == 0;
}

Expected<void> OutputFile::commit() {
  // If the file got its name before its bytes were on the disk, a power cut could leave an empty file with this name.
  if (error_ == 0 && !beside_.empty() && ::fsync(descriptor_) != 0 && errno != EINVAL && errno != EROFS) error_ = errno;
  if (::close(std::exchange(descriptor_, -1)) != 0 && error_ == 0) error_ = errno;
  if (error_ == 0 && !beside_.empty()) {
    Unfinished& all = unfinished();
    const std::lock_guard lock(all.mutex);
    if (::rename(beside_.c_str(), target_.c_str()) == 0) {
      all.files.erase(beside_);
      beside_.clear();
      error_ = sync_folder_of(target_);
    } else if (errno == EBUSY || errno == EXDEV) {
      // Something is mounted on the name, as containers do with single files. It can be overwritten but not replaced.
      error_ = copy_over(beside_, target_);
      if (error_ != 0) {
        all.files.erase(beside_);  // the only complete copy, so it stays
        return bad_output("'" + path_ + "' cannot be written: " + std::system_category().message(error_) +
                          ". The result is in '" + std::exchange(beside_, {}) + "'.");
      }
    } else {
      error_ = errno;
    }
  }
  if (error_ != 0) return not_written(path_, error_);
  return {};
}

void OutputFile::discard_all() {
  Unfinished& all = unfinished();
  all.mutex.lock();  // never unlocked, so that no other file is opened or renamed
  for (const std::string& file : all.files) ::unlink(file.c_str());
  all.files.clear();
}

}  // namespace varimesh
