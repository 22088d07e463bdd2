// What can go wrong with a device, as a value with a sentence. A caller decides by the kind whether the work can go on
// on the CPU.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace varimesh::device {

struct Fault {
  enum class Kind {
    NoDriver,     ///< There is no driver, or it finds no device.
    OldDriver,    ///< The driver or the device is too old for the kernels.
    Busy,         ///< Another process has the device for itself.
    OutOfMemory,  ///< The device has less free memory than was asked for, or than a kernel takes. Everything that was
                  ///< allocated stays.
    NoKernels,    ///< There are no kernels for this work, or none in this build.
    BadKernels,   ///< The driver did not accept the kernels, or the launch of one.
    Lost,         ///< The device failed. What was in its memory is gone, and every later call fails in the same way.
  };
  Kind kind = Kind::Lost;
  /// What was wrong, where, and what to do.
  std::string sentence;
};

/// A value, or the fault if there is none.
template <class T>
using Possible = tl::expected<T, Fault>;

inline tl::unexpected<Fault> fault(Fault::Kind kind, std::string sentence) {
  return tl::unexpected<Fault>({kind, std::move(sentence)});
}

}  // namespace varimesh::device
