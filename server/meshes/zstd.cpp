// Frames by libzstd. The table of frames follows zstd's contrib/seekable_format/zstd_seekable_compression_format.md.
#include "server/meshes/zstd.h"

#include <sys/stat.h>
#include <unistd.h>
#include <zstd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <limits>

#include "core/base/io/write_all.h"
#include "server/meshes/read_at.h"

namespace varimesh::server {
namespace {

/// Compression levels of chunks on the wire and of stored files.
constexpr int kWireLevel = 1, kFileLevel = 3;
constexpr std::uint32_t kSkippableMagic = 0x184D2A5E, kSeekableMagic = 0x8F92EAB1;
constexpr std::size_t kTableHeader = 8, kTableEntry = 8, kTableFooter = 9;
/// How many frames of a file are compressed to find out whether it is worth it.
constexpr std::size_t kSamples = 32;

bool is_worth_it(std::size_t compressed, std::size_t plain) { return compressed < plain - plain / 8; }

class Compressor {
 public:
  Compressor(int level, bool checksum) : context_(ZSTD_createCCtx()) {
    ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_compressionLevel, level);
    ZSTD_CCtx_setParameter(context_.get(), ZSTD_c_checksumFlag, checksum ? 1 : 0);
  }
  /// Replaces `frame` by one frame with these bytes.
  void compress(std::string_view bytes, std::string* frame) {
    frame->resize(ZSTD_compressBound(bytes.size()));
    const std::size_t size = ZSTD_compress2(context_.get(), frame->data(), frame->size(), bytes.data(), bytes.size());
    assert(!ZSTD_isError(size));  // the buffer is large enough
    frame->resize(size);
  }

 private:
  struct Free {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
  };
  std::unique_ptr<ZSTD_CCtx, Free> context_;
};

void put(std::uint32_t number, std::string* bytes) {
  for (int i = 0; i < 4; ++i, number >>= 8) *bytes += static_cast<char>(number & 255);
}

std::uint32_t number_at(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 4; i-- > 0;) number = number << 8 | static_cast<unsigned char>(bytes[at + i]);
  return number;
}

/// Compresses frames from all parts of the file to find out whether compressing all of it is worth it.
Compression try_samples(int file, std::size_t frames, Compressor& compressor) {
  std::string plain, frame;
  std::size_t before = 0, after = 0;
  for (std::size_t i = 0, last = frames; i < std::min(frames, kSamples); ++i) {
    const std::size_t sample = frames <= kSamples ? i : i * frames / kSamples;
    if (sample == last) break;
    if (!read_at(file, static_cast<std::int64_t>(sample * kFrameBytes), kFrameBytes, &plain))
      return Compression::Unreadable;
    last = sample;
    compressor.compress(plain, &frame);
    before += plain.size();
    after += frame.size();
  }
  return is_worth_it(after, before) ? Compression::Smaller : Compression::NotWorthIt;
}

}  // namespace

std::string zstd_compress(std::string_view bytes) {
  thread_local Compressor compressor(kWireLevel, false);
  std::string frame;
  compressor.compress(bytes, &frame);
  if (!is_worth_it(frame.size(), bytes.size())) frame.clear();
  return frame;
}

bool zstd_decompress(std::string_view frame, std::size_t most, std::string* bytes) {
  const unsigned long long size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (size == ZSTD_CONTENTSIZE_UNKNOWN || size == ZSTD_CONTENTSIZE_ERROR || size > most) return false;
  if (ZSTD_findFrameCompressedSize(frame.data(), frame.size()) != frame.size()) return false;
  bytes->resize(size);
  return ZSTD_decompress(bytes->data(), bytes->size(), frame.data(), frame.size()) == size;
}

Compression compress_file(int from, int to, const std::function<bool()>& given_up) {
  struct stat status {};
  if (::fstat(from, &status) != 0) return Compression::Unreadable;
  const auto size = static_cast<std::size_t>(status.st_size);
  const std::size_t frames = (size + kFrameBytes - 1) / kFrameBytes;
  if (frames > std::numeric_limits<std::uint32_t>::max() / kTableEntry) return Compression::NotWorthIt;
  Compressor compressor(kFileLevel, true);
  if (const Compression expected = try_samples(from, frames, compressor); expected != Compression::Smaller)
    return expected;
  std::string plain, frame, table;
  put(kSkippableMagic, &table);
  put(static_cast<std::uint32_t>(frames * kTableEntry + kTableFooter), &table);
  for (std::size_t i = 0; i < frames; ++i) {
    if (given_up()) return Compression::Failed;
    if (!read_at(from, static_cast<std::int64_t>(i * kFrameBytes), kFrameBytes, &plain)) return Compression::Unreadable;
    compressor.compress(plain, &frame);
    put(static_cast<std::uint32_t>(frame.size()), &table);
    put(static_cast<std::uint32_t>(plain.size()), &table);
    if (!write_all(to, frame)) return Compression::Failed;
  }
  put(static_cast<std::uint32_t>(frames), &table);
  table += '\0';  // no checksums in the table, since the frames have their own
  put(kSeekableMagic, &table);
  return write_all(to, table) ? Compression::Smaller : Compression::Failed;
}

// ===== reading =====

std::unique_ptr<ZstdFile> ZstdFile::open(int file) {
  std::unique_ptr<ZstdFile> opened(new ZstdFile(file));
  struct stat status {};
  if (::fstat(file, &status) != 0) return nullptr;
  errno = EBADMSG;  // unless the file cannot be read for another reason
  const auto end = static_cast<std::int64_t>(status.st_size);
  constexpr std::size_t kLeast = kTableHeader + kTableFooter;
  std::string table;
  if (end < static_cast<std::int64_t>(kLeast) ||
      !read_at(file, end - static_cast<std::int64_t>(kTableFooter), kTableFooter, &table) ||
      table.size() != kTableFooter || number_at(table, 5) != kSeekableMagic || table[4] != 0)
    return nullptr;
  const std::size_t frames = number_at(table, 0), table_size = kLeast + frames * kTableEntry;
  const std::int64_t begin = end - static_cast<std::int64_t>(table_size);
  if (begin < 0 || !read_at(file, begin, table_size, &table) || table.size() != table_size ||
      number_at(table, 0) != kSkippableMagic || number_at(table, 4) != table_size - kTableHeader)
    return nullptr;
  std::int64_t place = 0;
  opened->places_.push_back(place);
  for (std::size_t i = 0; i < frames; ++i) {
    const std::size_t entry = kTableHeader + i * kTableEntry;
    const std::uint32_t content = number_at(table, entry + 4);
    if (content > kFrameBytes || (content < kFrameBytes && i + 1 < frames)) return nullptr;
    opened->size_ += content;
    opened->places_.push_back(place += number_at(table, entry));
  }
  return place == begin ? std::move(opened) : nullptr;
}

ZstdFile::~ZstdFile() { ::close(file_); }

bool ZstdFile::read_frame(std::size_t frame, std::string* bytes) const {
  const auto size = static_cast<std::size_t>(places_[frame + 1] - places_[frame]);
  errno = EBADMSG;
  return read_at(file_, places_[frame], size, bytes) && bytes->size() == size;
}

bool ZstdFile::read_content(std::size_t frame, std::string* bytes) const {
  std::string compressed;
  return read_frame(frame, &compressed) && zstd_decompress(compressed, kFrameBytes, bytes);
}

}  // namespace varimesh::server
