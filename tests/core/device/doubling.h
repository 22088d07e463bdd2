// A kernel for tests of devices: doubles numbers. Its module is compressed as the build compresses PTX.
#pragma once

#include <zlib.h>

#include <string>
#include <vector>

#include "core/device/device.h"

namespace varimesh::testing {

struct Doubling {
  const double* from;
  double* to;
  std::int32_t count;

  static void run_block(const void* arguments, std::int32_t block, std::int32_t threads) {
    const auto& numbers = *static_cast<const Doubling*>(arguments);
    for (std::int32_t thread = 0; thread < threads; ++thread)
      if (const std::int32_t i = block * threads + thread; i < numbers.count) numbers.to[i] = 2 * numbers.from[i];
  }
};
inline constexpr device::CpuKernel kDoubling[] = {{"doubling", Doubling::run_block}};

/// As gzip writes it.
inline std::vector<unsigned char> packed(const std::string& text) {
  std::vector<unsigned char> out(compressBound(text.size()) + 64);
  z_stream stream{};
  deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, 16 + MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<unsigned>(text.size());
  stream.next_out = out.data();
  stream.avail_out = static_cast<unsigned>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

/// Doubles `count` numbers on the device, 0, 1, 2 and so on.
inline device::Possible<std::vector<double>> doubled(device::Device& device, const device::Module& module,
                                                     std::int32_t count) {
  std::vector<double> numbers(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < numbers.size(); ++i) numbers[i] = static_cast<double>(i);
  const auto kernel = module.kernel("doubling");
  if (!kernel) return tl::unexpected(kernel.error());
  const auto from = device.allocate_with<double>(numbers);
  if (!from) return tl::unexpected(from.error());
  const auto to = device.allocate(numbers.size() * sizeof(double));
  if (!to) return tl::unexpected(to.error());
  Doubling arguments{from->as<double>(), to->as<double>(), count};
  if (const auto done = device.launch(*kernel, {count}, &arguments); !done) return tl::unexpected(done.error());
  if (const auto done = to->download<double>(numbers); !done) return tl::unexpected(done.error());
  return numbers;
}

}  // namespace varimesh::testing
