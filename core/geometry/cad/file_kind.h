// Which CAD files there are, told by their beginning, since endings lie. Internal to the library.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace varimesh::geometry {

enum class CadFileKind { Unknown, Step, Iges, Brep, Binary };

/// The bytes of a file in which its kind shows.
inline constexpr std::size_t kBytesOfKind = 1024;

/// After white space and the mark of UTF-8, a STEP file begins with ISO-10303-21, and a BREP file and OpenCASCADE's
/// binary format with their own names. The first line of an IGES file has the letter S in column 73 and a number up to
/// column 80.
/// @param head  the first kBytesOfKind bytes, or more
inline CadFileKind kind_of_cad_file(std::string_view head) {
  head = head.substr(0, kBytesOfKind);
  const std::string_view line = head.substr(0, head.find_first_of("\r\n"));
  if (line.size() >= 80 && line[72] == 'S') {
    const std::size_t number = line.find_first_not_of(' ', 73);
    if (number < 80 && line.substr(0, 80).find_first_not_of("0123456789", number) == std::string_view::npos)
      return CadFileKind::Iges;
  }
  if (head.starts_with("\xef\xbb\xbf")) head.remove_prefix(3);
  head.remove_prefix(std::min(head.find_first_not_of(" \t\n\v\f\r"), head.size()));
  if (head.starts_with("ISO-10303-21")) return CadFileKind::Step;
  if (head.starts_with("DBRep_DrawableShape") || head.starts_with("CASCADE Topology")) return CadFileKind::Brep;
  return head.starts_with("Open CASCADE Topology") ? CadFileKind::Binary : CadFileKind::Unknown;
}

}  // namespace varimesh::geometry
