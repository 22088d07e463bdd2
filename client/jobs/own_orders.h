// Elements that came at a lower order than others: written at their own order again.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "client/io/outputs.h"
#include "core/base/error.h"

namespace varimesh::client {

inline constexpr const char* kKeepOrdersHelp =
    "Write elements that came at a lower order than others at their own order again, where this loses nothing";

/// Checks, before any work is done, whether write_own_orders() will find its files. Errors: BadOption.
Expected<void> check_own_orders(const std::string& input, const std::vector<Output>& outputs);

/// Writes the MSH files among the outputs of a run on the mesh `input` again, with its elements at their own orders
/// (formats::keep_orders_of()). `on_sentence` gets what became of them. Errors: those of reading and writing.
Expected<void> write_own_orders(const std::string& input, const std::vector<Output>& outputs, int threads,
                                const std::function<void(const std::string&)>& on_sentence);

}  // namespace varimesh::client
