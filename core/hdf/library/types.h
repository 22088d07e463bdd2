// Objects of HDF5, and its types by name.
#pragma once

#include <hdf5.h>

#include <stdexcept>
#include <string>
#include <string_view>

#include "core/hdf/content/source.h"

namespace varimesh::hdf {

/// What HDF5 or the system refuses: the reason becomes a part of the sentence.
struct Refusal : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// An object of HDF5, closed at the end of its scope.
class Handle {
 public:
  using Close = herr_t (*)(hid_t);
  /// Throws Refusal if HDF5 could not make the object; `what` says what was tried.
  Handle(hid_t id, Close close, const char* what);
  ~Handle();
  Handle(Handle&& other) noexcept : id_(other.id_), close_(other.close_) { other.id_ = -1; }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  Handle& operator=(Handle&&) = delete;

  operator hid_t() const { return id_; }

 private:
  hid_t id_;
  Close close_;
};

/// Throws Refusal if HDF5 reports a failure.
void check(herr_t result, const char* what);

/// The type with this name. Throws Refusal if there is none. Types: i1, i2, i4, i8, u2, f4, f8; b1 (a truth value); S9
/// (text of 9 bytes, the rest zero); F9 (the rest blanks); a type with a count in square brackets, such as i8[27];
/// members with names in braces, such as {cidx:i2,off:i8}, which lie side by side without gaps.
Handle type_of(std::string_view name);

/// What values of a type of a file are.
formats::hdf5::Kind kind_of(hid_t type);

}  // namespace varimesh::hdf
