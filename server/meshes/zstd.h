// zstd: frames on their way, and files of frames that can be read from any place.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace varimesh::server {

/// One frame of the bytes that says its content's size; nothing where it is not smaller by an eighth.
std::string zstd_compress(std::string_view bytes);
/// The content of one whole frame; false where it is none, is damaged, or has, or does not say that it has, at most
/// `most` bytes.
bool zstd_decompress(std::string_view frame, std::size_t most, std::string* bytes);

/// Bytes of content in each frame of a file but the last.
inline constexpr std::size_t kFrameBytes = 256 * 1024;

/// What came of an attempt to compress a file.
enum class Compression { Smaller, NotWorthIt, Unreadable, Failed };

/// Writes the file `from` to `to`, which is empty, as frames with checksums and a table of their places (zstd's
/// seekable format: the zstd program reads it too). NotWorthIt where samples do not become smaller by an eighth. Failed
/// where nothing more can be written (errno), or it was given up, which is asked before each frame.
Compression compress_file(int from, int to, const std::function<bool()>& given_up);

/// A file that compress_file() wrote.
class ZstdFile {
 public:
  /// Takes the descriptor over. Null where the file is no such one.
  static std::unique_ptr<ZstdFile> open(int file);
  ~ZstdFile();
  ZstdFile(const ZstdFile&) = delete;
  ZstdFile& operator=(const ZstdFile&) = delete;

  /// Of the content, in bytes.
  std::int64_t size() const { return size_; }
  std::size_t frames() const { return places_.size() - 1; }
  /// The frame as it is, or its content; false where it cannot be read.
  bool read_frame(std::size_t frame, std::string* bytes) const;
  bool read_content(std::size_t frame, std::string* bytes) const;

 private:
  explicit ZstdFile(int file) : file_(file) {}

  const int file_;
  std::int64_t size_ = 0;
  std::vector<std::int64_t> places_;  ///< Of the frames, and of their end.
};

}  // namespace varimesh::server
