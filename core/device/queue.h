// Calls of a device without a check after each.
#pragma once

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/device/device.h"

namespace varimesh::device {

/// Threads of a block.
inline constexpr int kBlock = 128;

/// Calls of a device, one after another. The first fault is kept, and nothing is done after it. So only code that needs
/// a result from the device has to look whether there was a fault.
class Queue {
 public:
  /// The device must outlive the object.
  explicit Queue(Device& device) : device_(device) {}

  const std::optional<Fault>& fault() const { return fault_; }
  bool is_well() const { return !fault_.has_value(); }
  /// Takes the fault of a call that was made without the queue.
  void note(const Possible<void>& done) {
    if (!done && is_well()) fault_ = done.error();
  }

  /// The module; null after a fault.
  std::unique_ptr<Module> load(const KernelImage& image);
  Kernel kernel(const Module* module, std::string_view name);

  /// Memory without a value.
  Buffer room(std::size_t bytes);
  /// Fills a buffer, and makes it first if it has another size.
  template <class Numbers>
  void fill(Buffer& buffer, const Numbers& numbers) {
    const std::span view(std::data(numbers), std::size(numbers));
    if (buffer.bytes() != view.size_bytes()) buffer = room(view.size_bytes());
    if (is_well()) note(buffer.upload(std::span<const typename decltype(view)::value_type>(view)));
  }
  template <class T>
  void download(const Buffer& buffer, std::span<T> numbers) {
    if (is_well()) note(buffer.download(numbers));
  }

  /// Launches one kernel with blocks of kBlock threads. `shared_bytes`: of a block.
  template <class Arguments>
  void launch(const Kernel& kernel, std::int64_t threads, Arguments arguments, int shared_bytes = 0) {
    if (is_well() && threads > 0) note(device_.launch(kernel, {threads, kBlock, shared_bytes}, &arguments));
  }

 private:
  Device& device_;
  std::optional<Fault> fault_;
};

}  // namespace varimesh::device
