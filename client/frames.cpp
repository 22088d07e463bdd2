#include "client/frames.h"

#include <zstd.h>

namespace varimesh::client {

std::string compress(std::string_view bytes) {
  constexpr int kFast = 1;
  std::string frame(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size = ZSTD_compress(frame.data(), frame.size(), bytes.data(), bytes.size(), kFast);
  const bool is_smaller = ZSTD_isError(size) == 0 && size < bytes.size() - bytes.size() / 8;
  frame.resize(is_smaller ? size : 0);
  return frame;
}

bool expand(std::string_view frame, std::size_t most, std::string* bytes) {
  const unsigned long long size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  if (size > most) return false;  // as the numbers that say that it is not known are
  bytes->resize(size);
  return ZSTD_decompress(bytes->data(), bytes->size(), frame.data(), frame.size()) == size;
}

}  // namespace varimesh::client
