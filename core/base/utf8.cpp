// Well-formed sequences are those of table 3-7 of the Unicode standard.
#include "core/base/utf8.h"

#include <cstddef>

namespace varimesh {

namespace {

// The length of the well-formed sequence at the beginning; 0 if there is none.
std::size_t sequence(std::string_view bytes) {
  const auto byte = [&](std::size_t i) -> unsigned { return static_cast<unsigned char>(bytes[i]); };
  const unsigned first = byte(0);
  if (first < 0x80) return 1;
  const std::size_t length = first >= 0xF0 ? 4 : first >= 0xE0 ? 3 : 2;
  if (first < 0xC2 || first > 0xF4 || bytes.size() < length) return 0;
  const unsigned lowest = first == 0xE0 ? 0xA0 : first == 0xF0 ? 0x90 : 0x80;
  const unsigned highest = first == 0xED ? 0x9F : first == 0xF4 ? 0x8F : 0xBF;
  if (byte(1) < lowest || byte(1) > highest) return 0;
  for (std::size_t i = 2; i < length; ++i)
    if (byte(i) < 0x80 || byte(i) > 0xBF) return 0;
  return length;
}

constexpr char kDigits[] = "0123456789abcdef";

std::string escaped_byte(char c) {
  const auto byte = static_cast<unsigned char>(c);
  return {'\\', 'x', kDigits[byte >> 4], kDigits[byte & 15]};
}

// The character of a well-formed sequence.
char32_t decode(std::string_view sequence) {
  constexpr unsigned char first_bits[] = {0, 0x7F, 0x1F, 0x0F, 0x07};
  char32_t character = static_cast<unsigned char>(sequence[0]) & first_bits[sequence.size()];
  for (const char c : sequence.substr(1)) character = character << 6 | (static_cast<unsigned char>(c) & 0x3F);
  return character;
}

// Whether a terminal does more than show it: controls (C0, DEL, C1), line and paragraph separators, and the marks,
// embeddings, overrides and isolates of bidirectional text.
bool is_control(char32_t c) {
  return c < 0x20 || (c >= 0x7F && c < 0xA0) || c == 0x061C || c == 0x200E || c == 0x200F ||
         (c >= 0x2028 && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069);
}

// One character, or one byte that is no character, as plain text.
std::string plain(std::string_view sequence, bool well_formed) {
  if (!well_formed) return escaped_byte(sequence[0]);
  const char32_t character = decode(sequence);
  if (!is_control(character)) return std::string(sequence);
  if (character < 0x80) return escaped_byte(sequence[0]);
  std::string text = "\\u";
  for (int shift = 12; shift >= 0; shift -= 4) text += kDigits[character >> shift & 15];
  return text;
}

// The beginning of the text with at most `most` bytes, or, if `backwards`, its end. No character is cut.
std::string_view part(std::string_view text, std::size_t most, bool backwards) {
  const auto inside = [&](std::size_t at) {
    return at < text.size() && (static_cast<unsigned char>(text[at]) & 0xC0) == 0x80;
  };
  std::size_t at = backwards ? text.size() - most : most;
  while (inside(at)) at += backwards ? 1 : static_cast<std::size_t>(-1);
  return backwards ? text.substr(at) : text.substr(0, at);
}

}  // namespace

bool is_utf8(std::string_view bytes) {
  while (!bytes.empty()) {
    const std::size_t length = sequence(bytes);
    if (length == 0) return false;
    bytes.remove_prefix(length);
  }
  return true;
}

std::string as_utf8(std::string_view bytes) {
  std::string text;
  while (!bytes.empty()) {
    const std::size_t length = sequence(bytes);
    text += length == 0 ? escaped_byte(bytes[0]) : std::string(bytes.substr(0, length));
    bytes.remove_prefix(length == 0 ? 1 : length);
  }
  return text;
}

std::string as_plain_text(std::string_view bytes, std::size_t most) {
  constexpr std::string_view gap = " ... ";
  // What is left out need not be converted. One byte gives at least a quarter of a byte of text.
  const std::size_t enough = 4 * most + 8;
  const bool is_long = bytes.size() > 2 * enough;
  const auto convert = [](std::string_view from) {
    std::string text;
    while (!from.empty()) {
      const std::size_t length = sequence(from);
      text += plain(from.substr(0, length == 0 ? 1 : length), length > 0);
      from.remove_prefix(length == 0 ? 1 : length);
    }
    return text;
  };
  const std::string head = convert(is_long ? bytes.substr(0, enough) : bytes);
  if (!is_long && head.size() <= most) return head;
  const std::string tail = is_long ? convert(bytes.substr(bytes.size() - enough)) : head;
  const std::size_t half = (most - gap.size()) / 2;
  return std::string(part(head, half, false)) + std::string(gap) + std::string(part(tail, half, true));
}

}  // namespace varimesh
