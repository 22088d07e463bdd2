#include "core/formats/nektar/packed.h"

#include <zlib.h>

#include <new>
#include <optional>

#include "core/formats/xml/encoding.h"

namespace varimesh::formats {

namespace {

constexpr std::size_t kPieceBytes = std::size_t(1) << 18;

/// A part of a zlib stream (RFC 1950): the parts behind each other are its content.
struct Part {
  std::string stream;
  uLong sum = 0;  ///< Adler's checksum of what was compressed.
  std::size_t bytes = 0;
};

Part compressed(const std::string& bytes, PackedValues values, bool last) {
  z_stream state{};
  // Level 1, because coordinates hardly compress: higher levels take four times as long and save a few per cent.
  // Coordinates hardly ever repeat what stands before them, so no time is spent on a search.
  const int strategy = values == PackedValues::Coordinates ? Z_HUFFMAN_ONLY : Z_DEFAULT_STRATEGY;
  if (deflateInit2(&state, 1, Z_DEFLATED, -MAX_WBITS, MAX_MEM_LEVEL - 1, strategy) != Z_OK) throw std::bad_alloc();
  constexpr std::size_t kFlush = 16;  // at most, behind what deflateBound() counts
  Part part{std::string(deflateBound(&state, uLong(bytes.size())) + kFlush, '\0'), adler32(0, nullptr, 0),
            bytes.size()};
  const auto* begin = reinterpret_cast<const Bytef*>(bytes.data());
  part.sum = adler32(part.sum, begin, uInt(bytes.size()));
  state.next_in = const_cast<Bytef*>(begin);
  state.avail_in = uInt(bytes.size());
  state.next_out = reinterpret_cast<Bytef*>(part.stream.data());
  state.avail_out = uInt(part.stream.size());
  // The next part begins with a byte of its own, and refers to nothing in this one.
  deflate(&state, last ? Z_FINISH : Z_FULL_FLUSH);
  part.stream.resize(part.stream.size() - state.avail_out);
  deflateEnd(&state);
  return part;
}

/// Base64 of bytes that come in pieces.
class Base64Output {
 public:
  explicit Base64Output(BufferedOutput& out) : out_(out) {}
  void put(std::string_view bytes) {
    rest_ += bytes;
    const std::size_t whole = rest_.size() / 3 * 3;
    encode(std::string_view(rest_).substr(0, whole));
    rest_.erase(0, whole);
  }
  void finish() { encode(rest_); }

 private:
  void encode(std::string_view bytes) {
    text_.clear();
    encode_base64(bytes, text_);
    out_.text(text_);
  }
  BufferedOutput& out_;
  std::string rest_, text_;
};

}  // namespace

void write_packed(BufferedOutput& out, PackedValues values, std::size_t count, std::size_t bytes_each,
                  const std::function<void(std::size_t begin, std::size_t end, std::string& bytes)>& fill) {
  const std::size_t per_piece = std::max<std::size_t>(1, kPieceBytes / std::max<std::size_t>(1, bytes_each));
  Base64Output base64(out);
  base64.put("\x78\x01");
  uLong sum = adler32(0, nullptr, 0);
  std::size_t next = 0;
  bool ended = false;
  const auto cut = [&]() -> std::optional<std::size_t> {
    if (ended) return std::nullopt;
    const std::size_t begin = next;
    next = std::min(count, begin + per_piece);
    ended = next == count;
    return begin;
  };
  const auto make = [&](std::size_t begin) {
    const std::size_t end = std::min(count, begin + per_piece);
    std::string bytes;
    bytes.reserve((end - begin) * bytes_each);
    fill(begin, end, bytes);
    return compressed(bytes, values, end == count);
  };
  in_order(out.team(), cut, make, [&](const Part& part) {
    base64.put(part.stream);
    sum = adler32_combine(sum, part.sum, z_off_t(part.bytes));
    return true;
  });
  const char tail[] = {char(sum >> 24), char(sum >> 16), char(sum >> 8), char(sum)};
  base64.put({tail, sizeof tail});
  base64.finish();
}

}  // namespace varimesh::formats
