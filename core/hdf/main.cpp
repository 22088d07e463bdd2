// varimesh_hdf5: reads a mesh from an HDF5 file or an older netCDF file, or writes an HDF5 file, in a process of its
// own, so that a damaged or hostile file harms only this process. core/formats/hdf5/process.cpp starts it.
//
//   varimesh_hdf5 read|write SECONDS BYTES
//
// What it is to do comes over the socket that is descriptor 3, and the result goes there
// (core/formats/hdf5/protocol.h). SECONDS of processor time and BYTES of memory are the limits; 0: none. Before it gets
// the bytes of a file, the process gives up the right to open files, to reach other processes and to use networks
// (core/process/sandbox.h).
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <limits>
#include <memory>
#include <new>
#include <optional>
#include <string>

#include "core/base/aligned.h"
#include "core/base/io/write_all.h"
#include "core/formats/hdf5/mesh_bytes.h"
#include "core/formats/hdf5/protocol.h"
#include "core/hdf/cgns/cgns.h"
#include "core/hdf/hopr/hopr.h"
#include "core/hdf/library/file.h"
#include "core/hdf/library/types.h"
#include "core/hdf/library/writer.h"
#include "core/hdf/netcdf/classic.h"
#include "core/hdf/pyfr/pyfr.h"
#include "core/hdf/read_content.h"
#include "core/process/sandbox.h"

namespace {

using namespace varimesh;
using formats::Format;
using formats::hdf5::Answer;
using formats::hdf5::Incoming;
using formats::hdf5::Order;
using formats::hdf5::Outcome;
using formats::hdf5::Outgoing;

/// Whoever started the program is gone.
struct Gone {};

std::size_t receive(std::span<char> to) {
  for (;;) {
    const ssize_t n = ::read(formats::hdf5::kSocket, to.data(), to.size());
    if (n > 0) return std::size_t(n);
    if (n == 0 || errno != EINTR) throw Gone();
  }
}

void send(std::string_view bytes) {
  if (!write_all(formats::hdf5::kSocket, bytes)) throw Gone();
}

void refuse(Outcome outcome, std::string why, Outgoing& to) {
  why.resize(std::min(why.size(), std::size_t(formats::hdf5::kMostSentence)));
  to.value(Answer{outcome, Format::Auto, std::int64_t(why.size())});
  to.put(why);
}

void read(const Order& order, Incoming& from, Outgoing& to) {
  UntouchedVector<char> bytes(std::size_t(std::max<std::int64_t>(0, order.bytes)));
  from.get(bytes);
  formats::FileAllowance allowance(bytes.size());
  const bool is_netcdf = std::string_view(bytes.data(), bytes.size()).starts_with("CDF");
  const auto source = is_netcdf ? formats::open_netcdf({bytes.data(), bytes.size()}, allowance) : hdf::open_file(bytes);
  formats::MeshFile file = formats::read_hdf5_content(*source, allowance);
  to.value(Answer{Outcome::Done, file.format, 0});
  formats::hdf5::send_mesh(std::move(file.mesh), to);
}

Expected<void> write(const HighOrderMesh& mesh, Format format, hdf::Writer& writer, const Team& team) {
  switch (format) {
    case Format::Hopr:
      return formats::write_hopr(mesh, writer, team);
    case Format::Cgns:
      return formats::write_cgns(mesh, writer, team);
    case Format::Pyfr:
      return formats::write_pyfr(mesh, writer, team);
    default:
      throw hdf::Refusal("the format is no HDF5 file");
  }
}

void write(const Order& order, hdf::Writer& writer, Incoming& from, Outgoing& to) {
  // The mesh comes from the library, which has it already.
  formats::FileAllowance unlimited(std::size_t(1) << 56);
  const HighOrderMesh mesh = formats::hdf5::receive_trusted_mesh(from, unlimited);
  const Team team(order.threads);
  Expected<void> written;
  team.run([&] { written = write(mesh, order.format, writer, team); });
  if (!written) return refuse(Outcome::Refused, written.error().sentence, to);
  const std::int64_t size = writer.finish();
  to.value(Answer{Outcome::Done, order.format, size});
  writer.send(size, to);
}

/// Does what is asked for. What fails becomes an answer.
void serve(hdf::Writer* writer, Incoming& from, Outgoing& to) {
  try {
    const auto order = from.value<Order>();
    if (order.version != formats::hdf5::kVersion) throw hdf::Refusal("varimesh_hdf5 has another version than VariMesh");
    writer == nullptr ? read(order, from, to) : write(order, *writer, from, to);
  } catch (const ReadFailure& failure) {
    refuse(Outcome::Refused, failure.sentence, to);
  } catch (const std::bad_alloc&) {
    refuse(Outcome::Failed, "it needs more memory than is available", to);
  } catch (const std::exception& failure) {
    refuse(Outcome::Failed, failure.what(), to);
  }
  to.flush();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  begin_confinement();
  Confinement keeps;
  keeps.processor_seconds = std::strtoll(argv[2], nullptr, 10);
  keeps.memory = std::strtoll(argv[3], nullptr, 10);
  setenv("HDF5_USE_FILE_LOCKING", "FALSE", 1);  // the file has no name, so no other process has it open
  unsetenv("HDF5_PLUGIN_PATH");
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // prints nothing
  H5PLset_loading_state(0);                     // loads no code that a file asks for
  Incoming from(receive);
  Outgoing to(send);
  try {
    std::optional<hdf::Writer> writer;
    try {
      if (std::strcmp(argv[1], "write") == 0) writer.emplace();
      keeps.threads = writer.has_value();
      if (writer) keeps.file_bytes = keeps.memory > 0 ? keeps.memory : std::numeric_limits<std::int64_t>::max();
    } catch (const std::exception& failure) {
      refuse(Outcome::Failed, failure.what(), to);
      to.flush();
      ::_exit(3);
    }
    (void)confine_this_process(keeps);  // on a system without filters, the limits remain
    serve(writer ? &*writer : nullptr, from, to);
  } catch (const Gone&) {
  }
  ::_exit(0);  // HDF5 would still close files that may be damaged
}
