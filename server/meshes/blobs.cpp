// Mappings, and readers that keep one piece in memory.
#include "server/meshes/blobs.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>

#include "core/base/write_all.h"
#include "server/meshes/zstd.h"
#include "server/operations/limits.h"

namespace varimesh::server {
namespace {

static_assert(kFrameBytes == kChunkBytes, "a stored frame is sent as it is");

/// A file mapped for reading. Its pages are dropped with it.
class MappedBlob : public Blob {
 public:
  MappedBlob(void* data, std::size_t size) : data_(data), size_(size) {}
  ~MappedBlob() override {
    if (data_ != nullptr) ::munmap(data_, size_);
  }
  std::string_view bytes() const override { return {static_cast<const char*>(data_), size_}; }

 private:
  void* data_;
  std::size_t size_;
};

tl::unexpected<Failure> unreadable() {
  return failure(Failure::Code::DataLoss, "INTERNAL",
                 "The stored mesh cannot be read any more; ask whoever runs the server to look at its disk.");
}

class PlainReader : public BlobReader {
 public:
  PlainReader(int file, std::int64_t size) : file_(file), size_(size) {}
  ~PlainReader() override { ::close(file_); }
  std::int64_t size() const override { return size_; }
  Answer<Piece> read(std::int64_t offset, bool zstd) override {
    Piece piece;
    piece.bytes.resize(std::min<std::size_t>(kChunkBytes, static_cast<std::size_t>(size_ - offset)));
    for (std::size_t filled = 0; filled < piece.bytes.size();) {
      const ssize_t got = ::pread(file_, piece.bytes.data() + filled, piece.bytes.size() - filled,
                                  offset + static_cast<std::int64_t>(filled));
      if (got < 0 && errno == EINTR) continue;
      if (got <= 0) return unreadable();
      filled += static_cast<std::size_t>(got);
    }
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

/// A file that is gone with its descriptor; −1 where none can be made.
int nameless_file(const std::filesystem::path& directory) {
  const int file = ::open(directory.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (file >= 0) return file;
  std::string path = (directory / "part-XXXXXX").string();  // not every file system has such files
  const int named = ::mkostemp(path.data(), O_CLOEXEC);
  if (named >= 0) ::unlink(path.c_str());
  return named;
}

}  // namespace

std::shared_ptr<const Blob> map_file(int file, std::size_t size) {
  if (size == 0) return std::make_shared<const MappedBlob>(nullptr, 0);
  void* data = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
  return data == MAP_FAILED ? nullptr : std::make_shared<const MappedBlob>(data, size);
}

std::shared_ptr<const Blob> expand_file(int file, const std::filesystem::path& directory) {
  const auto compressed = ZstdFile::open(file);
  const int expanded = compressed == nullptr ? -1 : nameless_file(directory);
  if (compressed == nullptr) errno = EIO;
  if (expanded < 0) return nullptr;
  std::shared_ptr<const Blob> blob;
  bool good = true;
  std::string content;
  for (std::size_t i = 0; good && i < compressed->frames(); ++i) {
    good = compressed->read_content(i, &content);
    if (!good) errno = EIO;
    good = good && write_all(expanded, content);
  }
  if (good) blob = map_file(expanded, static_cast<std::size_t>(compressed->size()));
  const int reason = errno;
  ::close(expanded);
  errno = reason;
  return blob;
}

std::unique_ptr<BlobReader> read_file(int file, Form form) {
  if (form == Form::Zstd) {
    auto compressed = ZstdFile::open(file);
    return compressed == nullptr ? nullptr : std::make_unique<FrameReader>(std::move(compressed));
  }
  struct stat facts {};
  if (::fstat(file, &facts) == 0) return std::make_unique<PlainReader>(file, facts.st_size);
  ::close(file);
  return nullptr;
}

}  // namespace varimesh::server
