// A device that runs kernels: memory, modules of kernels, launches. There are two implementations: a card through
// NVIDIA's driver (card.h), and this machine's processor (cpu_device.h), which runs the same kernels, compiled from the
// same source, one thread after another. So whatever uses a device can be tested on a machine without one.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/device/fault.h"

namespace varimesh::device {

struct Properties {
  std::string name;        ///< As the driver calls it.
  std::size_t memory = 0;  ///< Bytes in all.
  int capability = 0;      ///< Compute capability: ten times the major number plus the minor one.
  int multiprocessors = 0;
  int shared_memory = 0;  ///< Most bytes of shared memory per block.
  int driver = 0;         ///< The CUDA version of the driver: 1000 times the major number plus ten times the minor one.
};

/// One kernel as compiled for the processor: runs one block of threads, one thread after another.
struct CpuKernel {
  std::string_view name;
  void (*run_block)(const void* arguments, std::int32_t block, std::int32_t threads);
};

/// A module of kernels, compiled for both kinds of device.
struct KernelImage {
  std::string_view name;                  ///< For sentences.
  std::span<const unsigned char> packed;  ///< PTX, compressed by zlib. Empty: this build has none.
  std::span<const CpuKernel> cpu;
};

/// A kernel of a loaded module, valid as long as the module.
struct Kernel {
  const void* function = nullptr;
  std::string name;
};

/// How a kernel is launched: enough blocks of `block` threads for `threads` threads.
struct Launch {
  std::int64_t threads = 0;
  int block = 128;
  int shared_bytes = 0;  ///< Shared memory per block.

  std::int64_t blocks() const { return (threads + block - 1) / block; }
};

/// Loaded kernels. A module must not outlive its device.
class Module {
 public:
  virtual ~Module() = default;
  virtual Possible<Kernel> kernel(std::string_view name) const = 0;
};

class Buffer;

/// All functions may be called from any thread, from one at a time. A launch returns before the kernel has run; the
/// next download() waits for it. A fault of a kernel is returned by whichever call meets it first.
class Device {
 public:
  using Address = std::uint64_t;

  virtual ~Device() = default;
  virtual const Properties& properties() const = 0;
  virtual Possible<std::size_t> free_memory() = 0;

  /// Memory without a value. The buffer must not outlive the device.
  Possible<Buffer> allocate(std::size_t bytes);
  /// A buffer with a copy of these numbers.
  template <class T>
  Possible<Buffer> allocate_with(std::span<const T> numbers);

  virtual Possible<std::unique_ptr<Module>> load(const KernelImage& image) = 0;
  /// @param arguments  the kernel's only parameter, a struct; copied before the call returns
  virtual Possible<void> launch(const Kernel& kernel, const Launch& launch, void* arguments) = 0;
  /// Waits for all that was launched.
  virtual Possible<void> wait() = 0;

 private:
  friend class Buffer;
  virtual Possible<Address> allocate_bytes(std::size_t bytes) = 0;
  virtual void free_bytes(Address) = 0;
  virtual Possible<void> copy_in(Address to, const void* from, std::size_t bytes) = 0;
  virtual Possible<void> copy_out(void* to, Address from, std::size_t bytes) = 0;
};

/// Memory on a device, freed with the object.
class Buffer {
 public:
  Buffer() = default;
  Buffer(Device& device, Device::Address address, std::size_t bytes)
      : device_(&device), address_(address), bytes_(bytes) {}
  Buffer(Buffer&& other) noexcept
      : device_(std::exchange(other.device_, nullptr)), address_(other.address_), bytes_(other.bytes_) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(device_, other.device_);
    std::swap(address_, other.address_);
    std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Buffer() {
    if (device_ != nullptr) device_->free_bytes(address_);
  }

  std::size_t bytes() const { return device_ == nullptr ? 0 : bytes_; }
  /// The memory as kernels see it. Only kernels may follow the pointer. Null if there is no buffer.
  template <class T>
  T* as() const {
    return device_ == nullptr ? nullptr : std::bit_cast<T*>(address_);
  }

  /// `numbers` must fit. If there are none, nothing happens, and a buffer without memory will do.
  template <class T>
  Possible<void> upload(std::span<const T> numbers) {
    if (numbers.empty()) return {};
    return device_->copy_in(address_, numbers.data(), checked(numbers.size_bytes()));
  }
  template <class T>
  Possible<void> download(std::span<T> numbers) const {
    if (numbers.empty()) return {};
    return device_->copy_out(numbers.data(), address_, checked(numbers.size_bytes()));
  }

 private:
  std::size_t checked(std::size_t bytes) const;

  Device* device_ = nullptr;
  Device::Address address_ = 0;
  std::size_t bytes_ = 0;
};

template <class T>
Possible<Buffer> Device::allocate_with(std::span<const T> numbers) {
  auto buffer = allocate(numbers.size_bytes());
  if (buffer)
    if (const auto copied = buffer->upload(numbers); !copied) return tl::unexpected(copied.error());
  return buffer;
}

}  // namespace varimesh::device
