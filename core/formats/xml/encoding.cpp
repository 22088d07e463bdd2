#include "core/formats/xml/encoding.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <memory>

namespace varimesh::formats {

namespace {

constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
constexpr std::uint8_t kSpace = 64, kPadding = 65, kOther = 66;

constexpr std::array kValues = [] {
  std::array<std::uint8_t, 256> values{};
  for (std::size_t c = 0; c < 256; ++c) values[c] = c <= ' ' ? kSpace : kOther;
  for (std::size_t i = 0; i < kAlphabet.size(); ++i) values[static_cast<unsigned char>(kAlphabet[i])] = std::uint8_t(i);
  values['='] = kPadding;
  return values;
}();

}  // namespace

bool decode_base64(std::string_view text, std::string& bytes) {
  const std::size_t before = bytes.size();
  bytes.resize(before + text.size() / 4 * 3 + 3);
  char* out = bytes.data() + before;
  const auto value_at = [&](std::size_t i) { return kValues[static_cast<unsigned char>(text[i])]; };
  std::uint32_t group = 0;
  int digits = 0, padding = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    // Four digits at a time, as long as nothing else stands between them.
    for (; digits == 0 && i + 4 <= text.size(); i += 4) {
      const std::uint8_t a = value_at(i), b = value_at(i + 1), c = value_at(i + 2), d = value_at(i + 3);
      if ((a | b | c | d) >= kSpace) break;
      *out++ = char(a << 2 | b >> 4);
      *out++ = char(b << 4 | c >> 2);
      *out++ = char(c << 6 | d);
    }
    if (i == text.size()) break;
    const std::uint8_t value = value_at(i);
    if (value == kSpace) continue;
    if (value == kOther || (value != kPadding && padding > 0)) return false;
    if (value == kPadding) ++padding;
    group = group << 6 | (value == kPadding ? 0U : value);
    if (++digits < 4) continue;
    if (padding > 2) return false;
    for (int k = 0; k < 3 - padding; ++k) *out++ = char(group >> (16 - 8 * k) & 0xff);
    group = 0, digits = 0, padding = 0;
  }
  bytes.resize(std::size_t(out - bytes.data()));
  return digits == 0;
}

void encode_base64(std::string_view bytes, std::string& text) {
  const std::size_t before = text.size();
  text.resize(before + bytes.size() / 3 * 4);
  char* out = text.data() + before;
  std::size_t whole = 0;
  for (; whole + 3 <= bytes.size(); whole += 3) {
    const auto byte = [&](std::size_t k) { return std::uint32_t(static_cast<unsigned char>(bytes[whole + k])); };
    const std::uint32_t group = byte(0) << 16 | byte(1) << 8 | byte(2);
    for (int shift = 18; shift >= 0; shift -= 6) *out++ = kAlphabet[group >> shift & 63];
  }
  for (std::size_t at = whole; at < bytes.size(); at += 3) {
    const std::size_t n = std::min<std::size_t>(3, bytes.size() - at);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8 | (k < n ? static_cast<unsigned char>(bytes[at + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += k <= n ? kAlphabet[group >> (18 - 6 * k) & 63] : '=';
  }
}

namespace {

/// The beginning of base64 text: about `size` characters, whole groups of four digits, unless the text ends there.
std::string_view whole_groups(std::string_view text, std::size_t size) {
  if (text.size() <= size) return text;
  const auto is_digit = [](char c) { return static_cast<unsigned char>(c) > ' '; };
  auto digits = std::count_if(text.begin(), text.begin() + std::ptrdiff_t(size), is_digit);
  for (; digits % 4 != 0 && size < text.size(); ++size) digits += is_digit(text[size]) ? 1 : 0;
  return text.substr(0, size);
}

}  // namespace

Unpacked unpack_base64_zlib(std::string_view text, std::size_t record,
                            const std::function<void(std::string_view bytes, std::size_t done)>& body) {
  const std::size_t all = text.size();
  constexpr std::size_t kText = std::size_t(1) << 16, kBytes = std::size_t(1) << 18;
  z_stream state{};
  if (inflateInit(&state) != Z_OK) throw std::bad_alloc();
  const std::unique_ptr<z_stream, decltype(&inflateEnd)> owner(&state, inflateEnd);
  std::string packed, bytes(std::max(kBytes, record), '\0');
  std::size_t used = 0;
  bool begun = false, ended = false;
  const auto pass_on = [&](std::size_t size) {
    if (size > 0) body({bytes.data(), size}, all - text.size());
    std::memmove(bytes.data(), bytes.data() + size, used - size);
    used -= size;
  };
  while (!text.empty()) {
    const std::string_view piece = whole_groups(text, kText);
    text.remove_prefix(piece.size());
    packed.clear();
    if (!decode_base64(piece, packed)) return Unpacked::NotBase64;
    begun = begun || !packed.empty();
    state.next_in = reinterpret_cast<Bytef*>(packed.data());
    state.avail_in = uInt(packed.size());
    for (bool full = true; full && !ended && begun;) {
      state.next_out = reinterpret_cast<Bytef*>(bytes.data() + used);
      state.avail_out = uInt(bytes.size() - used);
      const int status = inflate(&state, Z_NO_FLUSH);
      if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) return Unpacked::Damaged;
      full = state.avail_out == 0;
      used = bytes.size() - state.avail_out;
      ended = status == Z_STREAM_END;
      pass_on(used / record * record);
    }
  }
  if (begun && !ended) return Unpacked::Damaged;
  pass_on(used);
  return Unpacked::Whole;
}

void deflate_zlib(std::string_view bytes, std::string& stream, int level) {
  z_stream state{};
  if (deflateInit(&state, level) != Z_OK) throw std::bad_alloc();
  const std::unique_ptr<z_stream, decltype(&deflateEnd)> owner(&state, deflateEnd);
  constexpr std::size_t kLargest = std::size_t(1) << 30;
  std::array<char, 1 << 16> piece;
  for (int status = Z_OK; status != Z_STREAM_END;) {
    if (state.avail_in == 0 && !bytes.empty()) {
      state.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
      state.avail_in = uInt(std::min(bytes.size(), kLargest));
      bytes.remove_prefix(state.avail_in);
    }
    state.next_out = reinterpret_cast<Bytef*>(piece.data());
    state.avail_out = uInt(piece.size());
    status = deflate(&state, bytes.empty() ? Z_FINISH : Z_NO_FLUSH);
    stream.append(piece.data(), piece.size() - state.avail_out);
  }
}

}  // namespace varimesh::formats
