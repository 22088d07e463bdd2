#include "client/report/packing.h"

#include <zlib.h>

#include <string_view>

namespace varimesh::client {
namespace {

std::string to_base64(std::string_view bytes) {
  constexpr char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto byte = [&](std::size_t k) {
      return i + k < bytes.size() ? std::uint32_t{static_cast<unsigned char>(bytes[i + k])} : 0U;
    };
    const std::uint32_t group = byte(0) << 16 | byte(1) << 8 | byte(2);
    text += digits[group >> 18];
    text += digits[group >> 12 & 63];
    text += i + 1 < bytes.size() ? digits[group >> 6 & 63] : '=';
    text += i + 2 < bytes.size() ? digits[group & 63] : '=';
  }
  return text;
}

}  // namespace

template <class Number>
void Packing::append(const std::string& name, const char* type, const std::vector<Number>& values) {
  directory_[name] = {{"type", type}, {"offset", bytes_.size()}, {"length", values.size()}};
  const auto* raw = reinterpret_cast<const char*>(values.data());
  // First the first bytes of all numbers, then the second bytes, and so on. Neighbouring numbers differ little, so this
  // compresses better.
  for (std::size_t byte = 0; byte < sizeof(Number); ++byte)
    for (std::size_t i = 0; i < values.size(); ++i) bytes_ += raw[i * sizeof(Number) + byte];
  bytes_.resize((bytes_.size() + 7) / 8 * 8);
}

void Packing::add(const std::string& name, const std::vector<float>& values) { append(name, "Float32", values); }
void Packing::add(const std::string& name, const std::vector<double>& values) { append(name, "Float64", values); }
void Packing::add(const std::string& name, const std::vector<std::int16_t>& values) { append(name, "Int16", values); }
void Packing::add(const std::string& name, const std::vector<std::int8_t>& values) { append(name, "Int8", values); }
void Packing::add(const std::string& name, const std::vector<std::int32_t>& values) {
  std::vector<std::int32_t> steps;
  std::uint32_t last = 0;
  for (const std::int32_t value : values) {
    steps.push_back(static_cast<std::int32_t>(static_cast<std::uint32_t>(value) - last));
    last = static_cast<std::uint32_t>(value);
  }
  append(name, "Int32", steps);
}
void Packing::add(const std::string& name, const std::vector<std::uint8_t>& values) { append(name, "Uint8", values); }

Expected<std::string> Packing::base64() const {
  std::string packed(compressBound(bytes_.size()), '\0');
  uLongf size = packed.size();
  if (compress2(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(bytes_.data()),
                bytes_.size(), Z_DEFAULT_COMPRESSION) != Z_OK)
    return tl::unexpected(Error{Error::Kind::Internal, "The report's data cannot be compressed; please report it."});
  packed.resize(size);
  return to_base64(packed);
}

}  // namespace varimesh::client
