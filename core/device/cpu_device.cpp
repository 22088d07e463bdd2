#include "core/device/cpu_device.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <new>

#include "core/base/machine_memory.h"

namespace varimesh::device {
namespace {

/// As cudaMalloc: kernels may take it that an array begins on a cache line.
constexpr std::align_val_t kAlignment{256};

class CpuModule final : public Module {
 public:
  explicit CpuModule(const KernelImage& image) : image_(image) {}

  Possible<Kernel> kernel(std::string_view name) const override {
    const auto found = std::ranges::find(image_.cpu, name, &CpuKernel::name);
    if (found == image_.cpu.end())
      return fault(Fault::Kind::BadKernels,
                   "The module " + std::string(image_.name) + " has no kernel " + std::string(name) + ".");
    return Kernel{&*found, std::string(name)};
  }

 private:
  KernelImage image_;
};

class CpuDevice final : public Device {
 public:
  CpuDevice() {
    properties_.name = "the processor";
    properties_.memory = static_cast<std::size_t>(machine_memory());
    properties_.shared_memory = std::numeric_limits<int>::max();
  }

  const Properties& properties() const override { return properties_; }
  Possible<std::size_t> free_memory() override { return properties_.memory; }

  Possible<std::unique_ptr<Module>> load(const KernelImage& image) override {
    return std::make_unique<CpuModule>(image);
  }

  Possible<void> launch(const Kernel& kernel, const Launch& launch, void* arguments) override {
    const auto* function = static_cast<const CpuKernel*>(kernel.function);
    for (std::int64_t block = 0; block < launch.blocks(); ++block)
      function->run_block(arguments, static_cast<std::int32_t>(block), launch.block);
    return {};
  }

  Possible<void> wait() override { return {}; }

 private:
  Possible<Address> allocate_bytes(std::size_t bytes) override {
    void* const memory = ::operator new(bytes, kAlignment, std::nothrow);
    if (memory == nullptr)
      return fault(Fault::Kind::OutOfMemory, "This machine has no " + std::to_string(bytes) + " bytes of free memory.");
    return reinterpret_cast<Address>(memory);
  }
  void free_bytes(Address address) override { ::operator delete(std::bit_cast<void*>(address), kAlignment); }
  Possible<void> copy_in(Address to, const void* from, std::size_t bytes) override {
    std::memcpy(std::bit_cast<void*>(to), from, bytes);
    return {};
  }
  Possible<void> copy_out(void* to, Address from, std::size_t bytes) override {
    std::memcpy(to, std::bit_cast<const void*>(from), bytes);
    return {};
  }

  Properties properties_;
};

}  // namespace

std::unique_ptr<Device> make_cpu_device() { return std::make_unique<CpuDevice>(); }

}  // namespace varimesh::device
