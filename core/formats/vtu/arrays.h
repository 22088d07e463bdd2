// The arrays of a VTK file: text, base64 or raw bytes, compressed or not. Internal to core/formats.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/team.h"
#include "core/formats/common/file_allowance.h"
#include "core/formats/xml/xml.h"

namespace varimesh::formats {

/// Where an array's values are.
enum class VtkPlace : std::uint8_t { Text, Inline, Appended };

/// A DataArray, as the file declares it.
struct VtkArray {
  std::string name;
  std::string type;  ///< Such as "Float64".
  int components = 1;
  VtkPlace place = VtkPlace::Text;
  XmlText text;            ///< Of arrays inside the XML.
  std::size_t offset = 0;  ///< Of appended arrays.
};

/// How the arrays of a file are encoded.
struct VtkEncoding {
  std::string_view file;
  bool swapped = false;       ///< The bytes of numbers have the other order than this machine.
  bool wide_headers = false;  ///< Headers are UInt64, otherwise UInt32.
  bool compressed = false;    ///< With zlib.
  bool raw = true;            ///< Appended data is raw, otherwise base64.
  std::size_t appended = 0;   ///< The byte after the underscore.
};

/// The values of an array; if `count` is given, exactly so many. T: double, or std::int64_t, std::int32_t and
/// std::uint8_t for whole numbers. Throws ReadFailure if the array has another number of values, if one is no T, or if
/// it is damaged. The threads of the team share the work of unpacking it.
template <class T>
std::vector<T> vtk_values(const VtkArray& array, std::optional<std::size_t> count, const VtkEncoding& encoding,
                          FileAllowance& allowance, const Team& team);

/// Calls begin(number of values), then body(values) for the values of an array, in order and some at a time, so that
/// they are never all in memory. Throws as vtk_values() does.
void for_vtk_values(const VtkArray& array, const VtkEncoding& encoding, FileAllowance& allowance, const Team& team,
                    const std::function<void(std::size_t)>& begin,
                    const std::function<void(std::span<const std::int32_t>)>& body);

}  // namespace varimesh::formats
