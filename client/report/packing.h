// Arrays of numbers for a page: their bytes are transposed, deflated together and encoded as base64.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/base/error.h"

namespace varimesh::client {

/// Collects named arrays. page/unpack.js unpacks them.
class Packing {
 public:
  void add(const std::string& name, const std::vector<float>& values);
  void add(const std::string& name, const std::vector<double>& values);
  void add(const std::string& name, const std::vector<std::int8_t>& values);
  void add(const std::string& name, const std::vector<std::int16_t>& values);
  /// Stores the differences between consecutive values, which are small if neighbours have similar numbers.
  void add(const std::string& name, const std::vector<std::int32_t>& values);
  void add(const std::string& name, const std::vector<std::uint8_t>& values);

  /// {name: {"type", "offset", "length"}}. The offset is in bytes and a multiple of 8, the length in numbers.
  const nlohmann::ordered_json& directory() const { return directory_; }
  /// All bytes, deflated to zlib's format, as base64. Errors: Internal.
  Expected<std::string> base64() const;

 private:
  template <class Number>
  void append(const std::string& name, const char* type, const std::vector<Number>& values);

  nlohmann::ordered_json directory_ = nlohmann::ordered_json::object();
  std::string bytes_;
};

}  // namespace varimesh::client
