// The kinds of points on curves, as Nektar++'s files name and number them. Internal to core/formats.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/formats/nektar/file.h"

namespace varimesh::formats {

/// The kind of points with a name or, in compressed files, a number of Nektar++'s PointsType.
inline std::optional<NektarPoints> points_of(std::string_view name) {
  if (name == "PolyEvenlySpaced" || name == "NodalTriEvenlySpaced") return NektarPoints::EvenlySpaced;
  if (name == "GaussLobattoLegendre") return NektarPoints::GaussLobatto;
  if (name == "NodalTriElec" || name == "NodalTriFekete") return NektarPoints::OtherTriangle;
  return std::nullopt;
}
inline std::string_view name_of_points(std::int64_t number) {
  switch (number) {
    case 4:
      return "GaussLobattoLegendre";
    case 17:
      return "PolyEvenlySpaced";
    case 22:
      return "NodalTriElec";
    case 23:
      return "NodalTriFekete";
    case 24:
      return "NodalTriEvenlySpaced";
    default:
      return "";
  }
}

}  // namespace varimesh::formats
