// How GoogleTest prints the enumerations of the core: by name, where it would otherwise print their bytes.
#pragma once

#include <ostream>

#include "core/energy/material.h"
#include "core/formats/formats.h"
#include "core/reference/shape.h"

namespace varimesh {

inline void PrintTo(Shape shape, std::ostream* out) { *out << reference::info(shape).name; }

inline void PrintTo(Energy energy, std::ostream* out) { *out << name(energy); }

namespace formats {

inline void PrintTo(Format format, std::ostream* out) {
  for (const FormatInfo& info : all())
    if (info.format == format) *out << info.name;
  if (format == Format::Auto) *out << "auto";
}

}  // namespace formats
}  // namespace varimesh
