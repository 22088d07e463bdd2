// How the processor runs kernels that are given thread by thread (kernels/solver_kernels.h): one block after another.
#pragma once

#include <cstdint>
#include <vector>

namespace varimesh::N_ONE_LANE {

/// Runs function(arguments, thread) for the threads of a block. The type of the function is written out, because it
/// chooses the instance of a function that is a template.
template <class Arguments, void (*function)(const Arguments&, std::int64_t)>
void run_each(const void* arguments, std::int32_t block, std::int32_t threads) {
  const auto& a = *static_cast<const Arguments*>(arguments);
  for (std::int32_t thread = 0; thread < threads; ++thread)
    function(a, static_cast<std::int64_t>(block) * threads + thread);
}

/// The same for a function whose result is not needed.
template <class Arguments, double (*function)(const Arguments&, std::int64_t)>
void run_each(const void* arguments, std::int32_t block, std::int32_t threads) {
  const auto& a = *static_cast<const Arguments*>(arguments);
  for (std::int32_t thread = 0; thread < threads; ++thread)
    function(a, static_cast<std::int64_t>(block) * threads + thread);
}

/// The same, and joins what the function returns in the tree that a card has (card/threads-inl.h, join_block).
template <class Arguments, double (*function)(const Arguments&, std::int64_t), auto member, class Join>
void run_joined(const void* arguments, std::int32_t block, std::int32_t threads) {
  const auto& a = *static_cast<const Arguments*>(arguments);
  std::vector<double> parts(static_cast<std::size_t>(threads));
  for (std::int32_t thread = 0; thread < threads; ++thread)
    parts[static_cast<std::size_t>(thread)] = function(a, static_cast<std::int64_t>(block) * threads + thread);
  for (std::size_t width = parts.size() / 2; width > 0; width /= 2)
    for (std::size_t i = 0; i < width; ++i) parts[i] = Join()(parts[i], parts[i + width]);
  (a.*member)[block] = parts[0];
}

}  // namespace varimesh::N_ONE_LANE
