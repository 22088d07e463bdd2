// What the readers take for each byte of an ordinary file, measured by MemoryOfReading.OrdinaryMeshesTakeWhatIsUsual.
#include "core/formats/usual_memory.h"

#include "core/formats/formats.h"

namespace varimesh::formats {

namespace {

/// Bytes of memory for a byte of the file.
int usual_memory(Format format) {
  switch (format) {
    case Format::Auto:  // is refused at once
      return 0;
    case Format::Msh22:
    case Format::Msh22Binary:
    case Format::Msh41:
    case Format::Msh41Binary:
      return 2;
    case Format::Mfem:
      return 3;
    case Format::Nektar:  // may be compressed
      return 6;
    case Format::Hopr:  // the program that reads HDF5 takes memory too
    case Format::Cgns:
    case Format::Exodus:
      return 8;
    default:
      return 4;
  }
}

}  // namespace

std::int64_t seldom_needed_to_read(std::string_view bytes) {
  const auto size = std::int64_t(bytes.size());
  return most_memory_to_read(size) - most_memory_to_read(0) - usual_memory(recognised(bytes)) * size;
}

}  // namespace varimesh::formats
