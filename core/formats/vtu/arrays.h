// The arrays of a VTK file: text, base64 or raw bytes, compressed or not. Internal to core/formats.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/formats/file_allowance.h"
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

/// The values of an array with exactly `count` values. Throws ReadFailure if the array has fewer or more, or is
/// damaged.
std::vector<double> vtk_numbers(const VtkArray& array, std::size_t count, const VtkEncoding& encoding,
                                FileAllowance& allowance);
/// The same for whole numbers; refuses an array of other types.
std::vector<std::int64_t> vtk_integers(const VtkArray& array, std::size_t count, const VtkEncoding& encoding,
                                       FileAllowance& allowance);
/// The same for any count.
std::vector<std::int64_t> vtk_integers(const VtkArray& array, const VtkEncoding& encoding, FileAllowance& allowance);

}  // namespace varimesh::formats
