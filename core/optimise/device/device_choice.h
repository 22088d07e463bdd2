// Which device a run works on.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/device/device.h"
#include "core/device/fault.h"
#include "core/device/run_device.h"
#include "core/options/options.h"

namespace varimesh {

/// From this many elements on, DeviceChoice::Auto takes a device: below, to begin with it takes longer than the run
/// saves. An estimate: beginning takes half a second, and a run on 50,000 quartic tetrahedra seconds.
inline constexpr std::int64_t kLeastElementsOnDevice = 50'000;

/// RunControl::open_device.
using OpenDevice = std::function<device::Possible<std::unique_ptr<device::Device>>()>;

/// The first card of NVIDIA's driver.
device::Possible<std::unique_ptr<device::Device>> open_first_card();

/// Whether a run with these options takes a device if there is one and the mesh is large enough.
bool may_take_device(const Options& options);

/// The device of a run, and what the result says about it.
class DeviceOfRun {
 public:
  /// Opens a device if the options ask for one and the run can use it.
  /// @param elements  of the mesh
  /// @param open      empty: open_first_card()
  DeviceOfRun(const Options& options, std::int64_t elements, const OpenDevice& open);

  /// Without a device if the run has none.
  device::RunDevice& get() { return device_; }
  /// What the result says: sets RunSummary::device, and adds to RunSummary::notes if the run has not worked on the
  /// device that was asked for.
  void tell(std::string& device, std::vector<std::string>& notes) const;

 private:
  bool is_demanded_ = false;  ///< DeviceChoice::Gpu.
  std::string why_not_;       ///< What follows "the processor" in a note if the run began without a device.
  device::RunDevice device_;
};

}  // namespace varimesh
