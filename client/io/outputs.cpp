#include "client/io/outputs.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <set>

#include "client/cli/names.h"
#include "client/library/failures.h"
#include "core/formats/formats.h"

namespace varimesh::client {
namespace {

v1::MeshFormat to_proto(formats::Format format) {
  for (const formats::FormatInfo& info : formats::all())
    if (info.format == format)
      if (const auto* value = value_of(*v1::MeshFormat_descriptor(), std::string(info.name)))
        return static_cast<v1::MeshFormat>(value->number());
  return v1::MESH_FORMAT_UNSPECIFIED;
}

/// Whether no other format has the ending of this one's file names, so that the ending says all.
bool ending_is_enough(formats::Format format) {
  const auto infos = formats::all();
  const auto own = std::find_if(infos.begin(), infos.end(), [&](const auto& info) { return info.format == format; });
  return std::count_if(infos.begin(), infos.end(),
                       [&](const auto& info) { return info.extension == own->extension; }) == 1;
}

/// Whether the file is a mesh whose format has other file names than .msh, so that a .msh cannot have its format.
bool is_other_than_msh(const std::string& input) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(input, error)) return false;
  std::array<char, 4096> begin{};
  std::ifstream file(input, std::ios::binary);
  file.read(begin.data(), std::ssize(begin));
  const formats::Format found = formats::recognised({begin.data(), std::size_t(file.gcount())});
  return found != formats::Format::Auto && ending_is_enough(found);
}

}  // namespace

Expected<std::vector<Output>> check_outputs(const std::vector<std::string>& paths, const std::string& format,
                                            const std::string& input) {
  formats::Format requested = formats::Format::Auto;
  if (!format.empty()) {
    const auto found = formats::from_name(format);
    if (!found) return tl::unexpected(found.error());
    requested = *found;
  }
  std::vector<Output> outputs;
  for (const std::string& path : paths) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
      return tl::unexpected(Error{Error::Kind::Output, "'" + path + "' is a folder; name a file in it."});
    const auto by_ending = formats::for_output(path, formats::Format::Auto, formats::Format::Auto);
    const bool ending_decides = by_ending && ending_is_enough(*by_ending);
    const auto chosen =
        formats::for_output(path, ending_decides ? formats::Format::Auto : requested, formats::Format::Auto);
    if (!chosen) return tl::unexpected(chosen.error());
    if (const auto writable = formats::check_writable(path); !writable) return tl::unexpected(writable.error());
    const bool as_read = requested == formats::Format::Auto && !ending_decides && !is_other_than_msh(input);
    outputs.push_back({path, as_read ? v1::MESH_FORMAT_UNSPECIFIED : to_proto(*chosen)});
  }
  return outputs;
}

Expected<void> check_distinct(const std::vector<Output>& outputs, const std::vector<std::string>& others, bool json) {
  std::vector<Output> all = outputs;
  for (const std::string& other : others) {
    if (other.empty()) continue;
    if (auto writable = formats::check_writable(other); !writable) return writable;
    all.push_back({other});
  }
  std::set<std::filesystem::path> seen;
  for (const Output& output : all) {
    std::error_code ignored;
    if (!seen.insert(std::filesystem::weakly_canonical(output.path, ignored)).second)
      return bad_option("Two outputs would be written to the file " + output.path +
                        ", and one of them would be lost; name a file for each.");
  }
  if (json && any_is_standard_output(all))
    return bad_option(
        "An output and the document of --json would both go to standard output; send the output to a file.");
  return {};
}

bool any_is_standard_output(const std::vector<Output>& outputs) {
  struct stat printed {};
  // A device that discards everything, such as /dev/null, cannot mix up two outputs.
  if (::fstat(STDOUT_FILENO, &printed) != 0 || (S_ISCHR(printed.st_mode) && isatty(STDOUT_FILENO) != 1)) return false;
  return std::any_of(outputs.begin(), outputs.end(), [&](const Output& output) {
    struct stat written {};
    return ::stat(output.path.c_str(), &written) == 0 && written.st_dev == printed.st_dev &&
           written.st_ino == printed.st_ino;
  });
}

std::vector<v1::MeshFormat> formats_of(const std::vector<Output>& outputs) {
  std::vector<v1::MeshFormat> formats;
  for (const Output& output : outputs)
    if (std::find(formats.begin(), formats.end(), output.format) == formats.end()) formats.push_back(output.format);
  return formats;
}

std::string interruption_text(const v1::Metrics& metrics, bool was_cut_short, const std::vector<Output>& outputs) {
  std::string written;
  for (const Output& output : outputs) written += (written.empty() ? "" : ", ") + output.path;
  const int iterations = metrics.iterations();
  const std::string when = !was_cut_short ? " after the run had ended; its result is in "
                           : iterations == 0 && metrics.layers().has_grown()
                               ? " before the first iteration; the mesh with its grown layer is in "
                           : iterations == 0 ? " before the first iteration; the mesh as it came is in "
                           : iterations == 1
                               ? " after 1 iteration; the best mesh so far is in "
                               : " after " + std::to_string(iterations) + " iterations; the best mesh so far is in ";
  return "interrupted" + when + written;
}

Outcome<void> fetch(Client& client, const v1::Job& job, const std::vector<Output>& outputs) {
  for (const Output& output : outputs) {
    // The results are in the order of the formats in the job's spec.
    int index = -1;
    for (int i = 0; i < job.results_size() && index < 0; ++i) {
      const bool asked = i < job.spec().outputs_size();
      const v1::MeshFormat as_asked = asked ? job.spec().outputs(i) : v1::MESH_FORMAT_UNSPECIFIED;
      if (as_asked == output.format || job.results(i).format() == output.format) index = i;
    }
    if (index < 0)
      return refusal("BAD_REQUEST", job.name() + " has no result in the format of " + output.path +
                                        "; fetch the result in a format that it has, and convert it.");
    if (auto done = client.download(job.results(index), output.path); !done) return done;
  }
  return {};
}

}  // namespace varimesh::client
