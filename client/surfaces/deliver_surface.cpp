#include "client/surfaces/deliver_surface.h"

#include <iostream>

#include "client/cli/names.h"
#include "client/io/documents.h"
#include "client/io/summary.h"
#include "client/process/exit_status.h"
#include "core/optimise/optimiser.h"

namespace varimesh::client {
namespace {

/// Writes the mesh. `says`: whether to print what a file leaves out.
Expected<void> write_outputs(const std::vector<Output>& outputs, const formats::MeshFile& slid, int threads,
                             bool says) {
  for (const Output& output : outputs) {
    const Expected<formats::Format> requested = output.format == v1::MESH_FORMAT_UNSPECIFIED
                                                    ? Expected<formats::Format>(formats::Format::Auto)
                                                    : formats::from_name(spelled(output.format));
    if (!requested) return tl::unexpected(requested.error());
    const auto format = formats::for_output(output.path, *requested, slid.format);
    if (!format) return tl::unexpected(format.error());
    if (const auto written = formats::write_file(slid.mesh, *format, output.path, {}, threads); !written)
      return tl::unexpected(written.error());
    const std::string lost = says ? formats::left_out(slid.mesh, *format) : "";
    if (!lost.empty()) std::cerr << lost << std::endl;
  }
  return {};
}

}  // namespace

int deliver_surface(const CommonFlags& flags, bool asks_for_job, const std::vector<Output>& outputs,
                    const formats::MeshFile& slid, int threads) {
  if (asks_for_job)
    return print_error({Error::Kind::BadOption,
                        "The mesh is a surface in space. Its nodes slide in this process, and --server, --history and "
                        "--report do not apply; leave them out."});
  if (const auto written = write_outputs(outputs, slid, threads, !flags.quiet); !written)
    return print_error(written.error());
  Options options;
  options.threads = threads;
  const auto mesh = summarise(slid.mesh, options);
  if (!mesh) return print_error(mesh.error());
  const QualityReport found = quality(slid.mesh, 0, threads);
  if (flags.json)
    print(document(*mesh, found, {}, what_is_left(slid.mesh, uncertified_numbers(found), {}, {})));
  else if (!flags.quiet)
    (any_is_standard_output(outputs) ? std::cerr : std::cout) << summary(*mesh, found);
  return print_uncertified(found.certified.invalid, found.certified.undecided);
}

}  // namespace varimesh::client
