// Arrays of numbers on their way into a page: transposed bytes, deflated together, as base64 text.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh::client {

/// Collects named arrays. page/unpack.js is the other side.
class Packing {
 public:
  void add(const std::string& name, const std::vector<float>& values);
  void add(const std::string& name, const std::vector<double>& values);
  void add(const std::string& name, const std::vector<std::int8_t>& values);
  void add(const std::string& name, const std::vector<std::int16_t>& values);
  /// As differences from one to the next, which are small where neighbours have similar numbers.
  void add(const std::string& name, const std::vector<std::int32_t>& values);
  void add(const std::string& name, const std::vector<std::uint8_t>& values);

  /// {name: {"type", "offset", "length"}}: offset in bytes, a multiple of 8, length in numbers.
  const nlohmann::ordered_json& directory() const { return directory_; }
  /// All the bytes, deflated (zlib's format). Errors: Internal.
  Expected<std::string> base64() const;

 private:
  template <class Number>
  void append(const std::string& name, const char* type, const std::vector<Number>& values);

  nlohmann::ordered_json directory_ = nlohmann::ordered_json::object();
  std::string bytes_;
};

}  // namespace varimesh::client
