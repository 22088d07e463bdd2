// A card through a driver: what works, and a sentence for each fault.
#include "core/device/card.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <memory>
#include <thread>

#include "tests/core/device/doubling.h"

namespace varimesh::device {
namespace {

using Kind = Fault::Kind;

/// Each test runs with a driver that is as FAKE_CUDA says.
class ACard : public ::testing::Test {
 protected:
  void TearDown() override { unsetenv("FAKE_CUDA"); }

  /// The driver in this state, and no card in use.
  Possible<Driver> driver(const char* state = "") {
    setenv("FAKE_CUDA", state, 1);
    fake<void(const CpuKernel*, std::size_t)>("fake_cuda_kernels")(testing::kDoubling, std::size(testing::kDoubling));
    return Driver::open(FAKE_DRIVER);
  }
  Possible<std::unique_ptr<Device>> card(const char* state = "") {
    const auto found = driver(state);
    return found ? found->use() : tl::unexpected(found.error());
  }
  KernelImage image() const { return {"doubling", ptx_, testing::kDoubling}; }

  /// What is held of the card: bytes, contexts and modules.
  std::array<std::size_t, 3> held() {
    std::size_t bytes = 0;
    int contexts = 0, modules = 0;
    fake<void(std::size_t*, int*, int*)>("fake_cuda_held")(&bytes, &contexts, &modules);
    return {bytes, static_cast<std::size_t>(contexts), static_cast<std::size_t>(modules)};
  }

  void expect(const Fault& fault, Kind kind, const std::string& sentence) {
    EXPECT_EQ(fault.kind, kind);
    EXPECT_EQ(fault.sentence, sentence);
  }

 private:
  template <class Function>
  Function* fake(const char* name) {
    return reinterpret_cast<Function*>(dlsym(dlopen(FAKE_DRIVER, RTLD_NOW | RTLD_LOCAL), name));
  }

  const std::vector<unsigned char> ptx_ = testing::packed(".version 6.3");
};

TEST_F(ACard, IsDescribed) {
  const auto found = driver("memory=150754820096");
  ASSERT_TRUE(found) << found.error().sentence;
  const auto cards = found->cards();
  ASSERT_TRUE(cards);
  ASSERT_EQ(cards->size(), 1U);
  const Properties& card = cards->front();
  EXPECT_EQ(card.name, "Fake Card 1");
  EXPECT_EQ(card.memory, 150754820096U);
  EXPECT_EQ(card.capability, 90);
  EXPECT_EQ(card.multiprocessors, 4);
  EXPECT_EQ(card.driver, 12040);
  EXPECT_EQ(held()[1], 0U) << "a description makes no context";
}

TEST_F(ACard, RunsKernelsAndGivesEverythingBack) {
  {
    const auto device = card();
    ASSERT_TRUE(device) << device.error().sentence;
    const auto module = (*device)->load(image());
    ASSERT_TRUE(module) << module.error().sentence;
    EXPECT_EQ(held(), (std::array<std::size_t, 3>{0, 1, 1}));
    const auto numbers = testing::doubled(**device, **module, 1000);
    ASSERT_TRUE(numbers) << numbers.error().sentence;
    EXPECT_EQ(numbers->back(), 1998);
  }
  EXPECT_EQ(held(), (std::array<std::size_t, 3>{0, 0, 0}));
}

TEST_F(ACard, WorksFromEveryThread) {
  const auto device = card();
  ASSERT_TRUE(device);
  const auto module = (*device)->load(image());
  ASSERT_TRUE(module);
  std::thread([&] { EXPECT_TRUE(testing::doubled(**device, **module, 10)); }).join();
}

TEST_F(ACard, IsNotThereWithoutADriver) {
  const auto none = Driver::open("libno_such_driver.so.1");
  ASSERT_FALSE(none);
  expect(none.error(), Kind::NoDriver,
         "There is no NVIDIA driver on this machine (libno_such_driver.so.1: cannot open shared object file: No such "
         "file or directory).");
}

TEST_F(ACard, IsNotThereIfTheDriverFindsNone) {
  const auto none = driver("cards=0");
  ASSERT_FALSE(none);
  expect(
      none.error(), Kind::NoDriver,
      "The NVIDIA driver finds no device. See whether 'nvidia-smi' finds one, and whether CUDA_VISIBLE_DEVICES hides "
      "it.");
}

TEST_F(ACard, NeedsADriverThatStarts) {
  expect(driver("result=999").error(), Kind::NoDriver, "The NVIDIA driver does not start: it says error 999.");
  expect(driver("result=803").error(), Kind::OldDriver,
         "The NVIDIA driver's library and its kernel module have different versions; restart the machine.");
}

TEST_F(ACard, NeedsADriverThatIsNotTooOld) {
  expect(
      driver("version=9020").error(), Kind::OldDriver,
      "The NVIDIA driver is too old: it is for CUDA 9.2, and VariMesh's kernels need CUDA 10.0. Install driver 410 or "
      "later.");
  expect(Driver::open(OLDER_DRIVER).error(), Kind::OldDriver,
         "The NVIDIA driver is too old: it has no function cuDriverGetVersion. Install driver 410 or later.");
  expect(Driver::open("libm.so.6").error(), Kind::OldDriver,
         "The NVIDIA driver is too old: it has no function cuInit. Install driver 410 or later.");
}

TEST_F(ACard, MustNotBeTooOld) {
  expect(card("capability=61").error(), Kind::OldDriver,
         "The device Fake Card 1 is too old: it has compute capability 6.1, and the kernels need 7.0.");
}

TEST_F(ACard, HasANumberThatExists) {
  const auto found = driver();
  ASSERT_TRUE(found);
  for (const int number : {-1, 1}) {
    const auto other = found->use(number);
    ASSERT_FALSE(other);
    EXPECT_EQ(other.error().kind, Kind::NoDriver);
  }
  EXPECT_EQ(found->use(1).error().sentence, "There is no device 1; the driver finds 1, and the first is 0.");
}

TEST_F(ACard, MayBelongToAnotherProcess) {
  expect(card("busy").error(), Kind::Busy,
         "The device Fake Card 1 is in use by another process, which has it for itself; wait until that process ends.");
}

TEST_F(ACard, SaysHowMuchMemoryIsFree) {
  const auto device = card("memory=3145728");
  ASSERT_TRUE(device);
  const auto first = (*device)->allocate(1 << 20);
  ASSERT_TRUE(first);
  EXPECT_EQ((*device)->free_memory(), std::size_t{2} << 20);
  const auto second = (*device)->allocate(5 << 20);
  ASSERT_FALSE(second);
  expect(second.error(), Kind::OutOfMemory,
         "The device Fake Card 1 has no room for 5 MiB: 2 MiB of 3 MiB are free. End what else uses it.");
  EXPECT_TRUE((*device)->allocate(2 << 20)) << "a refused allocation costs nothing";
}

TEST_F(ACard, SaysWhyKernelsDoNotLoad) {
  const auto device = card("load=218");
  ASSERT_TRUE(device);
  expect(
      (*device)->load(image()).error(), Kind::BadKernels,
      "The driver did not accept the kernels doubling (CUDA_ERROR_INVALID_PTX): ptxas fatal : line 1. This is an error "
      "in VariMesh or in the driver; please report it.");
  setenv("FAKE_CUDA", "load=222", 1);
  expect(
      (*device)->load(image()).error(), Kind::OldDriver,
      "The driver cannot compile the kernels doubling for the device Fake Card 1 (CUDA_ERROR_UNSUPPORTED_PTX_VERSION); "
      "install a later driver.");
  setenv("FAKE_CUDA", "load=2", 1);
  EXPECT_EQ((*device)->load(image()).error().kind, Kind::OutOfMemory);
  setenv("FAKE_CUDA", "", 1);
  EXPECT_TRUE((*device)->load(image())) << "none of these faults ends the context";
  expect((*device)->load({"doubling", {}, {}}).error(), Kind::NoKernels,
         "This build of VariMesh has no kernels doubling for a card.");
}

TEST_F(ACard, StaysLostOnceItIs) {
  for (const char* state : {"lost=2", "lost_at_wait=2"}) {
    {
      const auto device = card(state);
      ASSERT_TRUE(device);
      const auto module = (*device)->load(image());
      ASSERT_TRUE(module);
      ASSERT_TRUE(testing::doubled(**device, **module, 100)) << "the first launch is well";
      const auto kept = (*device)->allocate(64);
      const auto broken = testing::doubled(**device, **module, 100);
      ASSERT_FALSE(broken);
      expect(broken.error(), Kind::Lost,
             std::string("The device Fake Card 1 failed ") +
                 (state[4] == '=' ? "when it ran the kernel doubling" : "when results were copied from it") +
                 ": the driver says CUDA_ERROR_LAUNCH_FAILED. See what 'nvidia-smi' and 'dmesg' say about it.");
      EXPECT_EQ((*device)->allocate(8).error().sentence, broken.error().sentence) << "every later call says the same";
      EXPECT_EQ((*device)->load(image()).error().sentence, broken.error().sentence);
      EXPECT_EQ((*device)->wait().error().kind, Kind::Lost);
    }
    EXPECT_EQ(held()[1], 0U) << "the context is given back all the same";
  }
}

TEST_F(ACard, IsNotLostIfALaunchIsRefused) {
  const auto device = card("memory=3145728");
  ASSERT_TRUE(device);
  const auto module = (*device)->load(image());
  ASSERT_TRUE(module);
  {
    const auto kept = (*device)->allocate(1 << 20);
    ASSERT_TRUE(kept);
    setenv("FAKE_CUDA", "memory=3145728 launch=2", 1);
    const auto kernel = (*module)->kernel("doubling");
    ASSERT_TRUE(kernel);
    testing::Doubling nothing{nullptr, nullptr, 0};
    expect((*device)->launch(*kernel, {1, 32, 0}, &nothing).error(), Kind::OutOfMemory,
           "The device Fake Card 1 has no room for more when it ran the kernel doubling: 2 MiB of 3 MiB are free. End "
           "what else uses it.");
    setenv("FAKE_CUDA", "memory=3145728 launch=701", 1);
    expect((*device)->launch(*kernel, {1, 32, 0}, &nothing).error(), Kind::BadKernels,
           "The device Fake Card 1 cannot run the kernel doubling: it takes more registers or shared memory than 32 "
           "threads may have. This is an error in VariMesh; please report it.");
  }
  EXPECT_EQ(held()[0], 0U) << "memory is given back";
  setenv("FAKE_CUDA", "", 1);
  EXPECT_TRUE(testing::doubled(**device, **module, 100)) << "the device still works";
}

TEST_F(ACard, TakesNoNumbersWithoutMemory) {
  const auto device = card();
  ASSERT_TRUE(device);
  auto empty = (*device)->allocate(0);
  ASSERT_TRUE(empty);
  std::vector<double> none;
  EXPECT_TRUE(empty->upload<double>(none));
  EXPECT_TRUE(empty->download<double>(none));
}

TEST_F(ACard, HasTheSharedMemoryThatAKernelNeeds) {
  const auto device = card("shared=65536");
  ASSERT_TRUE(device);
  const auto module = (*device)->load(image());
  ASSERT_TRUE(module);
  const auto kernel = (*module)->kernel("doubling");
  ASSERT_TRUE(kernel);
  testing::Doubling nothing{nullptr, nullptr, 0};
  EXPECT_TRUE((*device)->launch(*kernel, {1, 32, 60000}, &nothing));
  const auto refused = (*device)->launch(*kernel, {1, 32, 70000}, &nothing);
  ASSERT_FALSE(refused);
  expect(refused.error(), Kind::OldDriver,
         "The device Fake Card 1 has 65536 bytes of shared memory per block, and the kernel doubling needs 70000.");
  EXPECT_TRUE((*device)->wait()) << "the device is not lost";
}

TEST_F(ACard, IsLostIfAnAccessIsWrong) {
  const auto device = card();
  ASSERT_TRUE(device);
  auto buffer = (*device)->allocate(8);
  ASSERT_TRUE(buffer);
  Buffer past(**device, reinterpret_cast<Device::Address>(buffer->as<char>() + 4), 8);
  const std::vector<double> one{1};
  EXPECT_EQ(past.upload<double>(one).error().kind, Kind::Lost);
  buffer = Buffer();
  EXPECT_EQ(held()[0], 0U) << "what the driver still frees is freed";
}

}  // namespace
}  // namespace varimesh::device
