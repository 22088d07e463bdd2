#include "core/device/unpack.h"

#include <zlib.h>

#include <cassert>

namespace varimesh::device {

std::string unpack(std::span<const unsigned char> packed) {
  // A gzip stream ends with the size of its text in four bytes.
  std::size_t size = 0;
  for (std::size_t i = 1; i <= 4; ++i) size = size << 8 | packed[packed.size() - i];
  std::string text(size, '\0');
  z_stream stream{};
  constexpr int kWithGzipHeader = 16 + MAX_WBITS;
  [[maybe_unused]] int result = inflateInit2(&stream, kWithGzipHeader);
  assert(result == Z_OK);
  stream.next_in = const_cast<unsigned char*>(packed.data());
  stream.avail_in = static_cast<unsigned>(packed.size());
  stream.next_out = reinterpret_cast<unsigned char*>(text.data());
  stream.avail_out = static_cast<unsigned>(size);
  result = inflate(&stream, Z_FINISH);
  assert(result == Z_STREAM_END);
  inflateEnd(&stream);
  return text;
}

}  // namespace varimesh::device
