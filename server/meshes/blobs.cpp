// Copies of whole files, and readers that have one piece in memory.
#include "server/meshes/blobs.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <utility>

#include "core/base/io/write_all.h"
#include "core/base/sha256.h"
#include "server/limits.h"
#include "server/meshes/read_at.h"
#include "server/meshes/zstd.h"
#include "server/refusals.h"

namespace varimesh::server {
namespace {

static_assert(kFrameBytes == kChunkBytes, "stored frames are sent without being compressed again");

class MemoryBlob : public Blob {
 public:
  explicit MemoryBlob(std::string bytes) : bytes_(std::move(bytes)) {}
  std::string_view bytes() const override { return bytes_; }

 private:
  const std::string bytes_;
};

/// A file mapped for reading. Only a file without a name is mapped: reading a page of a file that was truncated
/// meanwhile would end the process.
class MappedBlob : public Blob {
 public:
  /// Takes ownership of the descriptor.
  MappedBlob(int file, void* data, std::size_t size) : file_(file), data_(data), size_(size) {}
  ~MappedBlob() override {
    ::munmap(data_, size_);
    ::close(file_);
  }
  std::string_view bytes() const override { return {static_cast<const char*>(data_), size_}; }
  int file() const override { return file_; }

 private:
  const int file_;
  void* data_;
  std::size_t size_;
};

Refusal unreadable() {
  return data_lost("The stored mesh can no longer be read; ask the server's operator to check its disk.");
}

/// Reads an uncompressed file.
class PlainReader : public BlobReader {
 public:
  PlainReader(int file, std::int64_t size) : file_(file), size_(size) {}
  ~PlainReader() override { ::close(file_); }
  std::int64_t size() const override { return size_; }
  Answer<Piece> read(std::int64_t offset, bool zstd) override {
    Piece piece;
    const auto wanted = std::min<std::size_t>(kChunkBytes, static_cast<std::size_t>(size_ - offset));
    errno = EBADMSG;  // unless the file cannot be read for another reason
    if (!read_at(file_, offset, wanted, &piece.bytes) || piece.bytes.size() < wanted) return unreadable();
    piece.size = static_cast<std::int64_t>(piece.bytes.size());
    if (!zstd) return piece;
    if (std::string frame = zstd_compress(piece.bytes); !frame.empty()) {
      piece.bytes = std::move(frame);
      piece.is_zstd = true;
    }
    return piece;
  }

 private:
  const int file_;
  const std::int64_t size_;
};

/// Reads a compressed file. A piece is at most one frame.
class FrameReader : public BlobReader {
 public:
  explicit FrameReader(std::unique_ptr<ZstdFile> file) : file_(std::move(file)) {}
  std::int64_t size() const override { return file_->size(); }
  Answer<Piece> read(std::int64_t offset, bool zstd) override {
    Piece piece;
    if (offset == size()) return piece;
    const auto frame = static_cast<std::size_t>(offset) / kFrameBytes;
    const auto begin = static_cast<std::size_t>(offset) % kFrameBytes;
    const std::int64_t end = std::min<std::int64_t>(size(), static_cast<std::int64_t>((frame + 1) * kFrameBytes));
    piece.size = end - offset;
    piece.is_zstd = zstd && begin == 0;
    if (!(piece.is_zstd ? file_->read_frame(frame, &piece.bytes) : file_->read_content(frame, &piece.bytes)))
      return unreadable();
    if (!piece.is_zstd) piece.bytes.erase(0, begin);
    return piece;
  }

 private:
  const std::unique_ptr<ZstdFile> file_;
};

/// Creates a file without a name, which is deleted when its descriptor is closed. −1 if that fails (errno).
int nameless_file(const std::filesystem::path& directory) {
  const int file = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (file >= 0) return file;
  std::string path = (directory / "part-XXXXXX").string();  // some file systems do not support O_TMPFILE
  const int named = ::mkostemp(path.data(), O_CLOEXEC);
  if (named >= 0) ::unlink(path.c_str());
  return named;
}

/// Opens a reader without comparing anything. Null, with errno, if the file is damaged.
std::unique_ptr<BlobReader> open_reader(int file, Form form) {
  if (form == Form::Zstd) {
    auto compressed = ZstdFile::open(file);
    return compressed == nullptr ? nullptr : std::make_unique<FrameReader>(std::move(compressed));
  }
  struct stat status {};
  if (::fstat(file, &status) == 0) return std::make_unique<PlainReader>(file, status.st_size);
  const int reason = errno;
  ::close(file);
  errno = reason;
  return nullptr;
}

/// The files that were compared with their digests, and not changed since. Thread-safe.
class ComparedFiles {
 public:
  /// What tells one state of a file from another.
  struct State {
    dev_t device = 0;
    ino_t inode = 0;
    off_t size = 0;
    timespec changed{}, renamed{};  ///< Its bytes, and anything about it.

    bool operator==(const State& other) const {
      const auto same = [](const timespec& a, const timespec& b) {
        return a.tv_sec == b.tv_sec && a.tv_nsec == b.tv_nsec;
      };
      return device == other.device && inode == other.inode && size == other.size && same(changed, other.changed) &&
             same(renamed, other.renamed);
    }
  };
  /// Nothing if the file was changed a moment ago: its times could not tell another change from that one.
  static std::optional<State> of(int file) {
    struct stat status {};
    if (::fstat(file, &status) != 0 || ::time(nullptr) - status.st_mtim.tv_sec < kSettled) return std::nullopt;
    return State{status.st_dev, status.st_ino, status.st_size, status.st_mtim, status.st_ctim};
  }

  bool has(const std::optional<State>& state, const std::string& digest) {
    const std::lock_guard lock(mutex_);
    const auto found = files_.find(digest);
    return state && found != files_.end() && found->second.state == *state &&
           Clock::now() - found->second.compared < kLifetime;
  }
  void add(const std::optional<State>& state, const std::string& digest) {
    if (!state) return;
    const std::lock_guard lock(mutex_);
    if (files_.size() >= kMost) files_.clear();
    files_[digest] = {*state, Clock::now()};
  }

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::time_t kSettled = 2;  ///< Seconds.
  static constexpr std::chrono::minutes kLifetime{10};
  static constexpr std::size_t kMost = 10'000;
  struct Compared {
    State state;
    Clock::time_point compared;
  };

  std::mutex mutex_;
  std::unordered_map<std::string, Compared> files_;
};

ComparedFiles& compared_files() {
  static ComparedFiles files;
  return files;
}

/// Compares a file with its digest while a reader goes through it.
class FileCheck : public BlobCheck {
 public:
  FileCheck(std::unique_ptr<BlobReader> reader, Content content, std::optional<ComparedFiles::State> state)
      : reader_(std::move(reader)), content_(std::move(content)), state_(state) {}
  bool step() override {
    constexpr int kPieces = 16;
    for (int i = 0; i < kPieces && offset_ < reader_->size(); ++i) {
      const auto piece = reader_->read(offset_, false);
      if (!piece || piece->size == 0) return false;
      hash_.update(piece->bytes);
      offset_ += piece->size;
    }
    if (offset_ < reader_->size()) return true;
    if (offset_ == content_.size && hash_.finish() == content_.digest) compared_files().add(state_, content_.digest);
    return false;
  }

 private:
  const std::unique_ptr<BlobReader> reader_;
  const Content content_;
  const std::optional<ComparedFiles::State> state_;  ///< Before the first byte was read.
  Sha256 hash_;
  std::int64_t offset_ = 0;
};

/// Gives the bytes of a file to `take`, piece by piece. Returns false, with errno, if `take` does, or if the bytes are
/// not the content.
bool read_all(BlobReader& reader, const Content& content, const std::function<bool(std::string_view)>& take) {
  errno = EBADMSG;
  if (reader.size() != content.size) return false;
  Sha256 hash;
  for (std::int64_t offset = 0; offset < content.size;) {
    const auto piece = reader.read(offset, false);
    if (!piece) return false;
    errno = EBADMSG;
    if (piece->size == 0) return false;
    hash.update(piece->bytes);
    if (!take(piece->bytes)) return false;
    offset += piece->size;
  }
  const bool same = hash.finish() == content.digest;
  errno = EBADMSG;
  return same;
}

/// Takes ownership of the descriptor, unless it returns null.
std::shared_ptr<const Blob> map_file(int file, std::size_t size) {
  void* data = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
  return data == MAP_FAILED ? nullptr : std::make_shared<const MappedBlob>(file, data, size);
}

}  // namespace

std::shared_ptr<const Blob> load_file(int file, Form form, const Content& content,
                                      const std::filesystem::path& directory) {
  const auto reader = open_reader(file, form);
  if (reader == nullptr) return nullptr;
  if (content.size <= kMostInMemory) {
    std::string bytes;
    bytes.reserve(static_cast<std::size_t>(std::max<std::int64_t>(content.size, 0)));
    const bool good = read_all(*reader, content, [&](std::string_view piece) {
      bytes += piece;
      return true;
    });
    return good ? std::make_shared<const MemoryBlob>(std::move(bytes)) : nullptr;
  }
  const int copy = nameless_file(directory);
  if (copy < 0) return nullptr;
  std::shared_ptr<const Blob> blob;
  if (read_all(*reader, content, [&](std::string_view piece) { return write_all(copy, piece); }))
    blob = map_file(copy, static_cast<std::size_t>(content.size));
  if (blob != nullptr) return blob;
  const int reason = errno;
  ::close(copy);
  errno = reason;
  return nullptr;
}

bool is_whole(const std::filesystem::path& path, Form form, const std::string& digest) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW);
  const auto reader = file < 0 ? nullptr : open_reader(file, form);
  return reader != nullptr && read_all(*reader, {digest, reader->size()}, [](std::string_view) { return true; });
}

std::unique_ptr<BlobReader> read_file(int file, Form form, const Content& content) {
  const auto state = ComparedFiles::of(file);
  auto reader = open_reader(file, form);
  if (reader == nullptr || compared_files().has(state, content.digest)) return reader;
  if (!read_all(*reader, content, [](std::string_view) { return true; })) return nullptr;
  compared_files().add(state, content.digest);
  return reader;
}

std::unique_ptr<BlobCheck> check_file(int file, Form form, const Content& content) {
  const auto state = ComparedFiles::of(file);
  auto reader = open_reader(file, form);
  if (reader == nullptr || !state || compared_files().has(state, content.digest)) return nullptr;
  return std::make_unique<FileCheck>(std::move(reader), content, state);
}

}  // namespace varimesh::server
