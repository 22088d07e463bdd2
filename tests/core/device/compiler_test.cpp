// The kernel that makes a driver load its compiler.
#include "core/device/compiler.h"

#include <gtest/gtest.h>

#include <string>

#include "core/device/unpack.h"

namespace varimesh::device {
namespace {

/// Keeps the text of the module that it is given, and refuses it.
class Recorder final : public Device {
 public:
  std::string text;

  const Properties& properties() const override { return properties_; }
  Possible<std::size_t> free_memory() override { return 0; }
  Possible<std::unique_ptr<Module>> load(const KernelImage& image) override {
    text = unpack(image.packed);
    return fault(Fault::Kind::BadKernels, "refused");
  }
  Possible<void> launch(const Kernel&, const Launch&, void*) override { return {}; }
  Possible<void> wait() override { return {}; }

 private:
  Possible<Address> allocate_bytes(std::size_t) override { return 0; }
  void free_bytes(Address) override {}
  Possible<void> copy_in(Address, const void*, std::size_t) override { return {}; }
  Possible<void> copy_out(void*, Address, std::size_t) override { return {}; }

  Properties properties_;
};

TEST(Compiler, IsGivenAKernelForTheOldestCards) {
  Recorder device;
  load_compiler(device);
  EXPECT_EQ(device.text, ".version 6.3\n.target sm_70\n.address_size 64\n.visible .entry nothing()\n{\n\tret;\n}\n");
}

}  // namespace
}  // namespace varimesh::device
