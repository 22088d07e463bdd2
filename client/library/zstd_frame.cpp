#include "client/library/zstd_frame.h"

#include <zstd.h>

namespace varimesh::client {

std::string compress_frame(std::string_view bytes) {
  constexpr int kFastLevel = 1;
  std::string frame(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size = ZSTD_compress(frame.data(), frame.size(), bytes.data(), bytes.size(), kFastLevel);
  const bool is_smaller = ZSTD_isError(size) == 0 && size < bytes.size() - bytes.size() / 8;
  frame.resize(is_smaller ? size : 0);
  return frame;
}

bool expand_frame(std::string_view frame, std::size_t most, std::string* bytes) {
  const unsigned long long size = ZSTD_getFrameContentSize(frame.data(), frame.size());
  // The two values that stand for an unknown size and for an error are larger than any limit.
  if (size > most) return false;
  bytes->resize(size);
  return ZSTD_decompress(bytes->data(), bytes->size(), frame.data(), frame.size()) == size;
}

}  // namespace varimesh::client
