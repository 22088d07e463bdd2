#include "core/device/card.h"

#include <array>
#include <bit>

#include "core/device/unpack.h"

namespace varimesh::device {
namespace {

using cuda::Result;

std::string in_mebibytes(std::size_t bytes) { return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MiB"; }

/// "11.4" for 11040.
std::string version_text(int version) {
  return std::to_string(version / 1000) + "." + std::to_string(version % 1000 / 10);
}

std::string name_of(const cuda::Functions& driver, Result result) {
  const char* name = nullptr;
  if (driver.error_name(result, &name) != cuda::kSuccess || name == nullptr) return "error " + std::to_string(result);
  return name;
}

/// The fault for a result that no caller expects. By far the most of them end the context: a kernel that went wrong, a
/// card that fell off its bus, memory with an error. So all count as such.
tl::unexpected<Fault> lost(const cuda::Functions& driver, const std::string& card, Result result,
                           const std::string& when) {
  return fault(Fault::Kind::Lost, "The device " + card + " failed " + when + ": the driver says " +
                                      name_of(driver, result) + ". See what 'nvidia-smi' and 'dmesg' say about it.");
}

class CardModule final : public Module {
 public:
  CardModule(const cuda::Functions& driver, cuda::Context context, cuda::Module module, std::string name)
      : driver_(driver), context_(context), module_(module), name_(std::move(name)) {}
  ~CardModule() override {
    if (driver_.set_context(context_) == cuda::kSuccess) driver_.unload_module(module_);
  }
  CardModule(const CardModule&) = delete;
  CardModule& operator=(const CardModule&) = delete;

  Possible<Kernel> kernel(std::string_view name) const override {
    Kernel kernel{nullptr, std::string(name)};
    cuda::Function function = nullptr;
    Result result = driver_.set_context(context_);
    if (result == cuda::kSuccess) result = driver_.module_function(&function, module_, kernel.name.c_str());
    if (result != cuda::kSuccess)
      return fault(Fault::Kind::BadKernels, "The module " + name_ + " has no kernel " + kernel.name +
                                                ": the driver says " + name_of(driver_, result) + ".");
    kernel.function = function;
    return kernel;
  }

 private:
  const cuda::Functions& driver_;
  const cuda::Context context_;
  const cuda::Module module_;
  const std::string name_;
};

class Card final : public Device {
 public:
  Card(const cuda::Functions& driver, Properties properties, cuda::Ordinal ordinal, cuda::Context context)
      : driver_(driver), properties_(std::move(properties)), ordinal_(ordinal), context_(context) {}
  ~Card() override { driver_.release_context(ordinal_); }
  Card(const Card&) = delete;
  Card& operator=(const Card&) = delete;

  const Properties& properties() const override { return properties_; }

  Possible<std::size_t> free_memory() override {
    std::size_t free = 0, total = 0;
    const auto done =
        checked([&] { return driver_.free_memory(&free, &total); }, "when it was asked for its free memory");
    if (!done) return tl::unexpected(done.error());
    return free;
  }

  Possible<std::unique_ptr<Module>> load(const KernelImage& image) override {
    const std::string name(image.name);
    if (image.packed.empty())
      return fault(Fault::Kind::NoKernels, "This build of VariMesh has no kernels " + name + " for a card.");
    const std::string ptx = unpack(image.packed);
    cuda::Module module = nullptr;
    std::array<char, 1024> log{};
    int options[] = {cuda::kErrorLog, cuda::kErrorLogBytes};
    void* values[] = {log.data(), std::bit_cast<void*>(log.size() - 1)};
    if (const auto there = enter(); !there) return tl::unexpected(there.error());
    const Result result = driver_.load_module(&module, ptx.c_str(), 2, options, values);
    if (result == cuda::kOutOfMemory) return tl::unexpected(out_of_memory("the kernels " + name));
    if (result == cuda::kUnsupportedPtxVersion || result == cuda::kNoBinaryForDevice)
      return fault(Fault::Kind::OldDriver, "The driver cannot compile the kernels " + name + " for the device " +
                                               properties_.name + " (" + name_of(driver_, result) +
                                               "); install a later driver.");
    if (result == cuda::kInvalidPtx || result == cuda::kInvalidImage)
      return fault(Fault::Kind::BadKernels, "The driver did not accept the kernels " + name + " (" +
                                                name_of(driver_, result) + ")" +
                                                (log[0] != '\0' ? ": " + std::string(log.data()) : std::string()) +
                                                ". This is an error in VariMesh or in the driver; please report it.");
    if (const auto done = judged(result, "while it loaded the kernels " + name); !done)
      return tl::unexpected(done.error());
    return std::make_unique<CardModule>(driver_, context_, module, name);
  }

  Possible<void> launch(const Kernel& kernel, const Launch& launch, void* arguments) override {
    if (launch.blocks() == 0) return {};
    // The driver takes a function without const and changes nothing that we see.
    const auto function = static_cast<cuda::Function>(const_cast<void*>(kernel.function));
    const std::string when = "when it ran the kernel " + kernel.name;
    constexpr int kAlwaysAllowed = 48 << 10;
    if (launch.shared_bytes > kAlwaysAllowed) {
      if (launch.shared_bytes > properties_.shared_memory)
        return fault(Fault::Kind::OldDriver, "The device " + properties_.name + " has " +
                                                 std::to_string(properties_.shared_memory) +
                                                 " bytes of shared memory per block, and the kernel " + kernel.name +
                                                 " needs " + std::to_string(launch.shared_bytes) + ".");
      auto allowed = checked(
          [&] { return driver_.set_function_attribute(function, cuda::kMostDynamicSharedMemory, launch.shared_bytes); },
          when);
      if (!allowed) return allowed;
    }
    void* parameters[] = {arguments};
    if (auto there = enter(); !there) return there;
    const Result result =
        driver_.launch(function, static_cast<unsigned>(launch.blocks()), 1, 1, static_cast<unsigned>(launch.block), 1,
                       1, static_cast<unsigned>(launch.shared_bytes), nullptr, parameters, nullptr);
    if (result == cuda::kTooManyResources)
      return fault(Fault::Kind::BadKernels, "The device " + properties_.name + " cannot run the kernel " + kernel.name +
                                                ": it takes more registers or shared memory than " +
                                                std::to_string(launch.block) +
                                                " threads may have. This is an error in VariMesh; please report it.");
    return judged(result, when);
  }

  Possible<void> wait() override {
    return checked([&] { return driver_.wait(); }, "while it ran kernels");
  }

 private:
  Possible<Address> allocate_bytes(std::size_t bytes) override {
    if (const auto there = enter(); !there) return tl::unexpected(there.error());
    Address address = 0;
    const Result result = driver_.allocate(&address, bytes);
    if (result == cuda::kOutOfMemory) return tl::unexpected(out_of_memory(in_mebibytes(bytes)));
    if (const auto done = judged(result, "when memory was allocated"); !done) return tl::unexpected(done.error());
    return address;
  }

  void free_bytes(Address address) override {
    // The context of a lost device may be at its end. Then nothing is left to free, and the driver says so.
    if (driver_.set_context(context_) == cuda::kSuccess) driver_.free(address);
  }

  Possible<void> copy_in(Address to, const void* from, std::size_t bytes) override {
    return checked([&] { return driver_.to_device(to, from, bytes); }, "when data were copied to it");
  }

  Possible<void> copy_out(void* to, Address from, std::size_t bytes) override {
    return checked([&] { return driver_.from_device(to, from, bytes); }, "when results were copied from it");
  }

  /// Makes the context that of this thread. Fails if the device was lost earlier.
  Possible<void> enter() {
    if (lost_.kind == Fault::Kind::Lost && !lost_.sentence.empty()) return tl::unexpected(lost_);
    return judged(driver_.set_context(context_), "when its context was taken up");
  }

  template <class Call>
  Possible<void> checked(const Call& call, const std::string& when) {
    if (auto there = enter(); !there) return there;
    return judged(call(), when);
  }

  /// @param when  what was done, for sentences: "when it ran a kernel"
  Possible<void> judged(Result result, const std::string& when) {
    if (result == cuda::kSuccess) return {};
    if (result == cuda::kOutOfMemory) return tl::unexpected(out_of_memory("more " + when));
    auto failed = lost(driver_, properties_.name, result, when);
    lost_ = failed.value();
    return failed;
  }

  Fault out_of_memory(const std::string& what) {
    std::size_t free = 0, total = 0;
    const bool known = driver_.free_memory(&free, &total) == cuda::kSuccess;
    return {Fault::Kind::OutOfMemory,
            "The device " + properties_.name + " has no room for " + what +
                (known ? ": " + in_mebibytes(free) + " of " + in_mebibytes(total) + " are free" : "") +
                ". End what else uses it."};
  }

  const cuda::Functions driver_;
  const Properties properties_;
  const cuda::Ordinal ordinal_;
  const cuda::Context context_;
  Fault lost_;  ///< Without a sentence: not lost.
};

}  // namespace

Possible<Driver> Driver::open(const char* library) {
  Driver driver;
  cuda::Functions& f = driver.functions_;
  bool is_open = false;
  if (const char* const missing = cuda::open_functions(library, f, is_open); missing != nullptr) {
    if (!is_open)
      return fault(Fault::Kind::NoDriver, "There is no NVIDIA driver on this machine (" + std::string(missing) + ").");
    return fault(Fault::Kind::OldDriver, "The NVIDIA driver is too old: it has no function " + std::string(missing) +
                                             ". Install driver 410 or later.");
  }
  if (f.driver_version(&driver.version_) == cuda::kSuccess && driver.version_ < kOldestDriver)
    return fault(Fault::Kind::OldDriver, "The NVIDIA driver is too old: it is for CUDA " +
                                             version_text(driver.version_) + ", and VariMesh's kernels need CUDA " +
                                             version_text(kOldestDriver) + ". Install driver 410 or later.");
  const Result started = f.init(0);
  if (started == cuda::kNoDevice)
    return fault(
        Fault::Kind::NoDriver,
        "The NVIDIA driver finds no device. See whether 'nvidia-smi' finds one, and whether CUDA_VISIBLE_DEVICES "
        "hides it.");
  if (started == cuda::kSystemDriverMismatch)
    return fault(Fault::Kind::OldDriver,
                 "The NVIDIA driver's library and its kernel module have different versions; restart the machine.");
  if (started != cuda::kSuccess)
    return fault(Fault::Kind::NoDriver, "The NVIDIA driver does not start: it says " + name_of(f, started) + ".");
  return driver;
}

Possible<std::vector<Properties>> Driver::cards() const {
  const cuda::Functions& f = functions_;
  int count = 0;
  Result result = f.device_count(&count);
  std::vector<Properties> cards;
  for (int number = 0; number < count && result == cuda::kSuccess; ++number) {
    Properties& card = cards.emplace_back();
    cuda::Ordinal ordinal = 0;
    std::array<char, 256> name{};
    int major = 0, minor = 0;
    card.driver = version_;
    for (const Result one :
         {f.device(&ordinal, number), f.device_name(name.data(), name.size() - 1, ordinal),
          f.device_memory(&card.memory, ordinal), f.device_attribute(&major, cuda::kCapabilityMajor, ordinal),
          f.device_attribute(&minor, cuda::kCapabilityMinor, ordinal),
          f.device_attribute(&card.multiprocessors, cuda::kMultiprocessors, ordinal),
          f.device_attribute(&card.shared_memory, cuda::kMostSharedMemoryPerBlock, ordinal)})
      if (one != cuda::kSuccess) result = one;
    card.name = name.data();
    card.capability = 10 * major + minor;
  }
  if (result != cuda::kSuccess)
    return fault(Fault::Kind::NoDriver,
                 "The NVIDIA driver does not describe its devices: it says " + name_of(f, result) + ".");
  if (cards.empty()) return fault(Fault::Kind::NoDriver, "The NVIDIA driver finds no device.");
  return cards;
}

Possible<std::unique_ptr<Device>> Driver::use(int number) const {
  const auto known = cards();
  if (!known) return tl::unexpected(known.error());
  if (number < 0 || number >= static_cast<int>(known->size()))
    return fault(Fault::Kind::NoDriver, "There is no device " + std::to_string(number) + "; the driver finds " +
                                            std::to_string(known->size()) + ", and the first is 0.");
  const Properties& card = (*known)[static_cast<std::size_t>(number)];
  if (!is_new_enough(card))
    return fault(Fault::Kind::OldDriver, "The device " + card.name + " is too old: it has compute capability " +
                                             std::to_string(card.capability / 10) + "." +
                                             std::to_string(card.capability % 10) + ", and the kernels need 7.0.");
  cuda::Ordinal ordinal = 0;
  cuda::Context context = nullptr;
  Result result = functions_.device(&ordinal, number);
  if (result == cuda::kSuccess) result = functions_.retain_context(&context, ordinal);
  if (result == cuda::kDeviceUnavailable)
    return fault(Fault::Kind::Busy, "The device " + card.name +
                                        " is in use by another process, which has it for itself; wait until that "
                                        "process ends.");
  if (result == cuda::kOutOfMemory)
    return fault(Fault::Kind::OutOfMemory,
                 "The device " + card.name + " has no room for another process; end what else uses it.");
  if (result != cuda::kSuccess) return lost(functions_, card.name, result, "when a context was made");
  return std::make_unique<Card>(functions_, card, ordinal, context);
}

}  // namespace varimesh::device
