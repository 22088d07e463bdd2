// NVIDIA's cards, through their driver. The driver is looked for when these functions are called; nothing depends on it
// before.
#pragma once

#include <memory>
#include <vector>

#include "core/device/cuda_api.h"
#include "core/device/device.h"
#include "core/device/fault.h"

namespace varimesh::device {

/// The oldest driver and the oldest card that the kernels are compiled for: PTX 6.3 for sm_70.
inline constexpr int kOldestDriver = 10000;
inline constexpr int kOldestCapability = 70;

/// Whether the card's compute capability is at least kOldestCapability.
inline bool is_new_enough(const Properties& card) { return card.capability >= kOldestCapability; }

inline constexpr const char* kDriverLibrary = "libcuda.so.1";

/// The driver, initialised.
class Driver {
 public:
  /// @param library  the driver's library; tests name another one
  static Possible<Driver> open(const char* library = kDriverLibrary);

  /// The cards that the driver shows to this process, in its order. Makes no context and takes no memory.
  Possible<std::vector<Properties>> cards() const;

  /// The card with this number as a device: makes a context, which takes about a third of a second and some hundred MiB
  /// of the card's memory.
  Possible<std::unique_ptr<Device>> use(int number = 0) const;

 private:
  cuda::Functions functions_{};
  int version_ = 0;
};

}  // namespace varimesh::device
