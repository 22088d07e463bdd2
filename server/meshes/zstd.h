// zstd: single frames for the wire, and files of frames that can be read from any position.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace varimesh::server {

/// Returns one frame that states the size of its content, or nothing if it is not at least an eighth smaller than the
/// bytes.
std::string zstd_compress(std::string_view bytes);
/// Decompresses one whole frame. Returns false if it is not exactly one frame, is damaged, or does not state that its
/// content has at most `most` bytes.
bool zstd_decompress(std::string_view frame, std::size_t most, std::string* bytes);

/// Bytes of content in each frame of a file. The last frame may have fewer.
inline constexpr std::size_t kFrameBytes = 256 * 1024;

/// The outcome of an attempt to compress a file.
enum class Compression { Smaller, NotWorthIt, Unreadable, Failed };

/// Compresses the file `from` into the empty file `to`, as frames with checksums and a table of their positions (zstd's
/// seekable format, which the zstd program can read). Returns NotWorthIt if samples do not become at least an eighth
/// smaller; Failed, with errno, if `to` cannot be written; and Failed if `given_up`, which is called before each frame,
/// returns true.
Compression compress_file(int from, int to, const std::function<bool()>& given_up);

/// A file that compress_file() has written.
class ZstdFile {
 public:
  /// Takes ownership of the descriptor. Null, with errno, if the file cannot be read; EBADMSG if it is not of this
  /// kind.
  static std::unique_ptr<ZstdFile> open(int file);
  ~ZstdFile();
  ZstdFile(const ZstdFile&) = delete;
  ZstdFile& operator=(const ZstdFile&) = delete;

  /// Size of the content, in bytes.
  std::int64_t size() const { return size_; }
  std::size_t frames() const { return places_.size() - 1; }
  /// Reads the compressed frame, or its content. Returns false, with errno, if it cannot be read; EBADMSG if its
  /// bytes have changed.
  bool read_frame(std::size_t frame, std::string* bytes) const;
  bool read_content(std::size_t frame, std::string* bytes) const;

 private:
  explicit ZstdFile(int file) : file_(file) {}

  const int file_;
  std::int64_t size_ = 0;
  std::vector<std::int64_t> places_;  ///< Positions of the frames in the file, and of their end.
};

}  // namespace varimesh::server
