// Starts the program that reads a CAD file in a process of its own. Internal to core/geometry.
#pragma once

#include <string>

#include "core/base/error.h"

namespace varimesh::geometry {

/// An open file without a name, which is gone when this object is.
class Nameless {
 public:
  explicit Nameless(const char* purpose);
  ~Nameless();
  Nameless(Nameless&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }
  Nameless(const Nameless&) = delete;
  Nameless& operator=(const Nameless&) = delete;
  Nameless& operator=(Nameless&&) = delete;

  int descriptor() const { return descriptor_; }
  /// By which this process can open it.
  std::string path() const;

 private:
  int descriptor_;
};

/// Reads the file `path` with the program `reader` and returns the shape in OpenCASCADE's binary format. The process
/// has limits on time and memory, and ends when this one does. Errors: BadInput if the file cannot be read, or if the
/// process crashed or reached a limit; BadOption if the program cannot be started.
Expected<Nameless> read_in_child(const std::string& reader, const std::string& path);

}  // namespace varimesh::geometry
