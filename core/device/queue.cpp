#include "core/device/queue.h"

namespace varimesh::device {

std::unique_ptr<Module> Queue::load(const KernelImage& image) {
  if (!is_well()) return nullptr;
  auto module = device_.load(image);
  if (module) return std::move(*module);
  fault_ = module.error();
  return nullptr;
}

Kernel Queue::kernel(const Module* module, std::string_view name) {
  if (!is_well()) return {};
  auto kernel = module->kernel(name);
  if (kernel) return std::move(*kernel);
  fault_ = kernel.error();
  return {};
}

Buffer Queue::room(std::size_t bytes) {
  if (!is_well()) return {};
  auto buffer = device_.allocate(bytes);
  if (buffer) return std::move(*buffer);
  fault_ = buffer.error();
  return {};
}

}  // namespace varimesh::device
