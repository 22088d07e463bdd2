// A library that takes the place of NVIDIA's driver in tests. It has one card, whose memory is this process's. Where a
// module has the kernels of cells, the processor's kernels run in their place; else those that a test has registered
// with fake_cuda_kernels(). It refuses what the real driver refuses: calls without a context, copies past the end of an
// allocation, memory that was freed.
//
// CUDA_VISIBLE_DEVICES numbers the card: with 1 it is called Fake Card 2.
//
// The variable FAKE_CUDA, or a file `state` beside this library, says what is wrong with it, in words with a space
// between them:
//   version=10010      the version of CUDA that it is for
//   result=803         cuInit() ends with this result
//   cards=0            how many cards there are
//   capability=60      of the card
//   busy               another process has the card for itself
//   memory=4096        bytes of memory
//   load=218           loading a module ends with this result
//   launch=701         launches end with this result, and nothing else happens
//   lost=3             the third launch breaks the card: every later call ends with 719
//   lost_at_wait=3     the third launch breaks the card, and the next call that waits is the first to say so
//   shared=49152       bytes of shared memory per block
//   busy_for=300       making a context takes this many milliseconds
//   thread             making a context starts a thread that lives on
//   crash=3            the third launch ends the process
//   wrong              results that are copied from the card have a wrong bit
#include <dlfcn.h>

#include <bit>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <thread>

#include "core/device_kernels/cell_modules.h"
#include "core/device_kernels/cpu/modules.h"
#include "tests/core/energy/materials.h"

namespace {

using varimesh::device::CpuKernel;

using Result = int;
constexpr Result kSuccess = 0, kInvalidValue = 1, kOutOfMemory = 2, kNotInitialised = 3, kUnavailable = 46,
                 kNoDevice = 100, kInvalidContext = 201, kNotFound = 500, kLaunchFailed = 719;

/// The number after `word` in FAKE_CUDA; `otherwise` if the word is not there.
long setting(const std::string& word, long otherwise) {
  const char* all = std::getenv("FAKE_CUDA");
  const std::string text = " " + std::string(all == nullptr ? "" : all) + " ";
  if (const auto at = text.find(" " + word + "="); at != std::string::npos)
    return std::atol(text.c_str() + at + word.size() + 2);
  return text.find(" " + word + " ") != std::string::npos ? 1 : otherwise;
}

struct Card {
  std::map<std::uint64_t, std::size_t> allocated;
  std::size_t used = 0;
  int contexts = 0, modules = 0, launches = 0;
  bool lost = false, lost_silently = false;
  std::span<const CpuKernel> kernels;
};
Card card;
bool initialised = false;
thread_local void* current = nullptr;
char context_of_card;

std::size_t memory() { return static_cast<std::size_t>(setting("memory", 1L << 30)); }

Result ready() {
  if (!initialised) return kNotInitialised;
  if (card.lost) return kLaunchFailed;
  return current == &context_of_card ? kSuccess : kInvalidContext;
}

/// Whether these bytes lie in one allocation.
bool is_allocated(std::uint64_t address, std::size_t bytes) {
  auto after = card.allocated.upper_bound(address);
  if (after == card.allocated.begin()) return false;
  const auto& [first, size] = *--after;
  return address - first + bytes <= size;
}

/// The number that a module of this text has by this name.
std::optional<int> mark(std::string_view text, std::string_view name) {
  const std::string wanted = std::string(name) + " = ";
  const auto at = text.find(wanted);
  if (at == std::string_view::npos) return std::nullopt;
  return std::atoi(text.data() + at + wanted.size());
}

/// The processor's kernels for a module of this text.
std::span<const CpuKernel> kernels_of(std::string_view text) {
  namespace device = varimesh::device;
  if (const auto dimension = mark(text, "solver_dimension")) return device::solver_kernels(*dimension).cpu;
  if (const auto dimension = mark(text, "descent_dimension")) return device::descent_kernels(*dimension).cpu;
  if (const auto dimension = mark(text, "judge_dimension")) return device::judge_kernels(*dimension).cpu;
  if (const auto dimension = mark(text, "any_cells")) {
    for (const varimesh::NamedMaterial& one : varimesh::every_material())
      if (device::energy_number(*dimension, one.material) == mark(text, "energy_number"))
        return device::general_kernels(*dimension, one.material).cpu;
    return {};
  }
  const auto kind = mark(text, "cell_kind");
  if (!kind) return card.kernels;
  const varimesh::Material material = varimesh::material(varimesh::Options{});
  for (int shape = 0; shape < varimesh::kShapes; ++shape)
    for (int order = 1; order <= varimesh::kMaxOrder; ++order)
      if (const auto module = device::cell_kernels(static_cast<varimesh::Shape>(shape), order, material);
          module && device::number_of(module->kind) == *kind)
        return module->image.cpu;
  return {};
}

Result waited() {
  if (card.lost_silently) card.lost = true;
  return ready();
}

}  // namespace

extern "C" {

/// For tests: the kernels of every module that is loaded from now on.
void fake_cuda_kernels(const CpuKernel* kernels, std::size_t count) {
  card = Card();
  card.kernels = {kernels, count};
}
/// For tests: bytes that are allocated, contexts that are held and modules that are loaded.
void fake_cuda_held(std::size_t* bytes, int* contexts, int* modules) {
  *bytes = card.used;
  *contexts = card.contexts;
  *modules = card.modules;
}

Result cuInit(unsigned) {
  if (Dl_info own{}; std::getenv("FAKE_CUDA") == nullptr && dladdr(reinterpret_cast<void*>(&cuInit), &own) != 0) {
    const std::string file = own.dli_fname;
    std::string state;
    if (std::ifstream in(file.substr(0, file.rfind('/') + 1) + "state"); std::getline(in, state))
      setenv("FAKE_CUDA", state.c_str(), 1);
  }
  const auto result = static_cast<Result>(setting("result", kSuccess));
  if (result == kSuccess && setting("cards", 1) == 0) return kNoDevice;
  initialised = result == kSuccess;
  return result;
}
Result cuDriverGetVersion(int* version) {
  *version = static_cast<int>(setting("version", 12040));
  return kSuccess;
}
Result cuGetErrorName(Result result, const char** name) {
  static const std::map<Result, const char*> names{
      {kInvalidValue, "CUDA_ERROR_INVALID_VALUE"},     {kOutOfMemory, "CUDA_ERROR_OUT_OF_MEMORY"},
      {kInvalidContext, "CUDA_ERROR_INVALID_CONTEXT"}, {kNotFound, "CUDA_ERROR_NOT_FOUND"},
      {kLaunchFailed, "CUDA_ERROR_LAUNCH_FAILED"},     {218, "CUDA_ERROR_INVALID_PTX"},
      {222, "CUDA_ERROR_UNSUPPORTED_PTX_VERSION"}};
  const auto found = names.find(result);
  *name = found == names.end() ? nullptr : found->second;
  return found == names.end() ? kInvalidValue : kSuccess;
}
Result cuDeviceGetCount(int* count) {
  *count = static_cast<int>(setting("cards", 1));
  return initialised ? kSuccess : kNotInitialised;
}
Result cuDeviceGet(int* device, int number) {
  *device = number;
  return number < setting("cards", 1) ? kSuccess : kInvalidValue;
}
Result cuDeviceGetName(char* name, int room, int) {
  const char* const visible = std::getenv("CUDA_VISIBLE_DEVICES");
  const int number = visible == nullptr ? 0 : std::atoi(visible);
  std::strncpy(name, ("Fake Card " + std::to_string(1 + number)).c_str(), static_cast<std::size_t>(room));
  return kSuccess;
}
Result cuDeviceGetAttribute(int* value, int attribute, int) {
  const long capability = setting("capability", 90);
  switch (attribute) {
    case 75:
      *value = static_cast<int>(capability / 10);
      return kSuccess;
    case 76:
      *value = static_cast<int>(capability % 10);
      return kSuccess;
    case 16:
      *value = 4;
      return kSuccess;
    case 97:
      *value = static_cast<int>(setting("shared", 232448));
      return kSuccess;
    default:
      return kInvalidValue;
  }
}
Result cuDeviceTotalMem_v2(std::size_t* bytes, int) {
  *bytes = memory();
  return kSuccess;
}
Result cuDevicePrimaryCtxRetain(void** context, int) {
  if (setting("busy", 0) != 0) return kUnavailable;
  std::this_thread::sleep_for(std::chrono::milliseconds(setting("busy_for", 0)));
  if (setting("thread", 0) != 0 && card.contexts == 0)
    std::thread([] { std::this_thread::sleep_for(std::chrono::hours(1)); }).detach();
  ++card.contexts;
  *context = &context_of_card;
  return kSuccess;
}
Result cuDevicePrimaryCtxRelease_v2(int) {
  --card.contexts;
  return kSuccess;
}
Result cuCtxSetCurrent(void* context) {
  current = context;
  return ready();
}
Result cuMemGetInfo_v2(std::size_t* free, std::size_t* total) {
  *free = memory() - card.used;
  *total = memory();
  return ready();
}
Result cuCtxSynchronize() { return waited(); }
Result cuModuleLoadDataEx(void** module, const void* image, unsigned options, int* names, void** values) {
  if (const Result result = ready(); result != kSuccess) return result;
  if (const auto result = static_cast<Result>(setting("load", kSuccess)); result != kSuccess) {
    for (unsigned i = 0; i < options; ++i)
      if (names[i] == 5) std::strcpy(static_cast<char*>(values[i]), "ptxas fatal : line 1");
    return result;
  }
  const std::string_view text(static_cast<const char*>(image));
  if (text.find(".version") == std::string_view::npos) return 218;
  ++card.modules;
  *module = new std::span<const CpuKernel>(kernels_of(text));
  return kSuccess;
}
Result cuModuleUnload(std::span<const CpuKernel>* module) {
  --card.modules;
  delete module;
  return ready();
}
Result cuModuleGetFunction(const void** function, const std::span<const CpuKernel>* module, const char* name) {
  for (const CpuKernel& kernel : *module)
    if (kernel.name == name) {
      *function = &kernel;
      return kSuccess;
    }
  return kNotFound;
}
Result cuFuncSetAttribute(void*, int attribute, int value) {
  return attribute == 8 && value <= setting("shared", 232448) ? kSuccess : kInvalidValue;
}
Result cuMemAlloc_v2(std::uint64_t* address, std::size_t bytes) {
  if (const Result result = ready(); result != kSuccess) return result;
  if (bytes > memory() - card.used) return kOutOfMemory;
  *address = reinterpret_cast<std::uint64_t>(std::aligned_alloc(256, (bytes + 255) / 256 * 256));
  card.allocated[*address] = bytes;
  card.used += bytes;
  return kSuccess;
}
Result cuMemFree_v2(std::uint64_t address) {
  const auto found = card.allocated.find(address);
  if (found == card.allocated.end()) return kInvalidValue;
  card.used -= found->second;
  card.allocated.erase(found);
  std::free(std::bit_cast<void*>(address));
  return kSuccess;
}
Result cuMemcpyHtoD_v2(std::uint64_t to, const void* from, std::size_t bytes) {
  if (const Result result = waited(); result != kSuccess) return result;
  if (!is_allocated(to, bytes)) return kInvalidValue;
  std::memcpy(std::bit_cast<void*>(to), from, bytes);
  return kSuccess;
}
Result cuMemcpyDtoH_v2(void* to, std::uint64_t from, std::size_t bytes) {
  if (const Result result = waited(); result != kSuccess) return result;
  if (!is_allocated(from, bytes)) return kInvalidValue;
  std::memcpy(to, std::bit_cast<const void*>(from), bytes);
  if (setting("wrong", 0) != 0) static_cast<char*>(to)[0] ^= 1;
  return kSuccess;
}
Result cuLaunchKernel(const void* function, unsigned blocks, unsigned, unsigned, unsigned threads, unsigned, unsigned,
                      unsigned shared, void*, void** arguments, void**) {
  if (const Result result = ready(); result != kSuccess) return result;
  if (shared > setting("shared", 232448) || blocks == 0) return kInvalidValue;
  if (const auto result = static_cast<Result>(setting("launch", kSuccess)); result != kSuccess) return result;
  ++card.launches;
  if (card.launches >= setting("crash", 1L << 30)) std::abort();
  if (card.launches >= setting("lost", 1L << 30)) card.lost = true;
  if (card.launches >= setting("lost_at_wait", 1L << 30)) card.lost_silently = true;
  if (card.lost || card.lost_silently) return ready();
  for (unsigned block = 0; block < blocks; ++block)
    static_cast<const CpuKernel*>(function)->run_block(arguments[0], static_cast<std::int32_t>(block),
                                                       static_cast<std::int32_t>(threads));
  return kSuccess;
}

}  // extern "C"
