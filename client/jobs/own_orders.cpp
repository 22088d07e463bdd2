#include "client/jobs/own_orders.h"

#include <algorithm>
#include <filesystem>

#include "core/formats/formats.h"
#include "core/formats/reading_notes.h"

namespace varimesh::client {
namespace {

bool is_device(const std::string& path) {
  std::error_code failed;
  const auto status = std::filesystem::status(path, failed);
  return !failed && std::filesystem::exists(status) && !std::filesystem::is_regular_file(status);
}

/// Only MSH files have the elements' numbers and may have elements of several orders.
bool is_msh_file(const Output& output) { return output.path.ends_with(".msh") && !is_device(output.path); }

}  // namespace

Expected<void> check_own_orders(const std::string& input, const std::vector<Output>& outputs) {
  if (is_device(input))
    return bad_option("--keep-orders reads the mesh again at the end; give it a file, not '" + input + "'.");
  if (std::ranges::none_of(outputs, is_msh_file))
    return bad_option("--keep-orders is for results in MSH files; name one with -o OUT.msh, or leave the flag out.");
  return {};
}

Expected<void> write_own_orders(const std::string& input, const std::vector<Output>& outputs, int threads,
                                const std::function<void(const std::string&)>& on_sentence) {
  const auto came = formats::read_file(input, machine_memory(), threads);
  if (!came) return tl::unexpected(came.error());
  for (const Output& output : outputs) {
    if (!is_msh_file(output)) continue;
    auto result = formats::read_file(output.path, machine_memory(), threads);
    if (!result) return tl::unexpected(result.error());
    formats::keep_orders_of(came->mesh, result->mesh);
    const std::string text = formats::left_out(result->mesh, result->format);
    on_sentence(text.empty() ? "No element came at a lower order than others, so --keep-orders changes nothing."
                             : text);
    if (const auto written = formats::write_file(result->mesh, result->format, output.path, {}, threads); !written)
      return written;
  }
  return {};
}

}  // namespace varimesh::client
