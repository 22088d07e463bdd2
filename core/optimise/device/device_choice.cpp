#include "core/optimise/device/device_choice.h"

#include <utility>

#include "core/device/card.h"

namespace varimesh {
namespace {

/// Why runs with these options make no Newton steps that a device can make; empty if they do.
std::string why_no_steps(const Options& options) {
  if (options.max_iterations == 0) return "no step was asked for";
  if (options.method == Method::Sweeps) return "sweeps run on the processor; leave the method at auto or newton";
  return {};
}

}  // namespace

device::Possible<std::unique_ptr<device::Device>> open_first_card() {
  const auto driver = device::Driver::open();
  if (!driver) return tl::unexpected(driver.error());
  return driver->use();
}

bool may_take_device(const Options& options) {
  return options.device != DeviceChoice::Cpu && why_no_steps(options).empty();
}

DeviceOfRun::DeviceOfRun(const Options& options, std::int64_t elements, const OpenDevice& open)
    : is_demanded_(options.device == DeviceChoice::Gpu) {
  const bool is_wanted = is_demanded_ || (options.device == DeviceChoice::Auto && elements >= kLeastElementsOnDevice);
  if (!is_wanted) return;
  if (const std::string reason = why_no_steps(options); !reason.empty()) {
    why_not_ = ": " + reason + ".";
    return;
  }
  auto opened = open ? open() : open_first_card();
  if (opened)
    device_ = device::RunDevice(std::move(*opened));
  else
    why_not_ = ". " + opened.error().sentence;
}

void DeviceOfRun::tell(std::string& device, std::vector<std::string>& notes) const {
  device = device_.done_on();
  const bool has_begun = !device.empty();
  const std::string where =
      has_begun ? "The run went on on the processor after a part of its steps" : "The run was on the processor";
  if (const auto& fault = device_.fault())
    notes.push_back((has_begun && !device_.has_ended() ? "A part of the run was on the processor" : where) + ". " +
                    fault->sentence);
  else if (is_demanded_ && !why_not_.empty())
    notes.push_back(where + why_not_);
  else if (is_demanded_ && !has_begun)
    notes.emplace_back(
        "The run made no step of Newton's method. The device could only help with certificates and quality.");
}

}  // namespace varimesh
