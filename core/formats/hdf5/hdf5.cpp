#include "core/formats/hdf5/hdf5.h"

#include <algorithm>
#include <array>
#include <new>

#include "core/formats/common/file_allowance.h"
#include "core/formats/hdf5/mesh_bytes.h"
#include "core/formats/hdf5/process.h"
#include "core/formats/hdf5/protocol.h"

namespace varimesh::formats {

namespace {

using hdf5::Answer;
using hdf5::Incoming;
using hdf5::Outcome;
using hdf5::Outgoing;
using namespace std::string_view_literals;

constexpr const char* kWrongAnswer = "HDF5 gave an answer of the wrong size, so the file is probably damaged";

/// Memory of the program besides what grows with the file or the mesh.
constexpr std::int64_t kProgramMemory = std::int64_t(1) << 29;

/// What the program refuses, as a whole sentence.
struct Refusal {
  std::string sentence;
};

/// The program's answer. Throws Refusal and Hdf5Failure.
Answer answer_of(Incoming& from) {
  const auto answer = from.value<Answer>();
  if (answer.outcome == Outcome::Done && answer.bytes >= 0) return answer;
  if (answer.bytes < 0 || answer.bytes > hdf5::kMostSentence) throw Hdf5Failure{kWrongAnswer};
  std::string why(std::size_t(answer.bytes), '\0');
  from.get(why);
  std::replace_if(
      why.begin(), why.end(), [](unsigned char c) { return c < ' '; }, '?');
  if (answer.outcome == Outcome::Refused) throw Refusal{why};
  throw Hdf5Failure{why};
}

Incoming incoming(Hdf5Process& program) {
  return Incoming([&](std::span<char> to) { return program.receive(to); });
}

/// About how many bytes a mesh has.
std::int64_t bytes_of(const HighOrderMesh& mesh) {
  auto bytes = std::int64_t(mesh.node_count() * (4 * sizeof(double)));
  for (const ElementBlock& block : mesh.blocks)
    bytes += std::int64_t(block.nodes.size() * sizeof(std::int32_t) + block.size() * sizeof(std::int64_t));
  return bytes;
}

void write(const HighOrderMesh& mesh, Format format, const Sink& sink, const Team& team, bool& stopped) {
  const std::int64_t bytes = bytes_of(mesh);
  // A thread takes its stack and an arena of the address space.
  constexpr std::int64_t kPerMesh = 16, kPerThread = std::int64_t(80) << 20;
  Hdf5Process program(true, bytes, kProgramMemory + kPerMesh * bytes + kPerThread * team.threads(), team.stop());
  Outgoing to([&](std::string_view part) { program.send(part); });
  to.value(hdf5::Order{hdf5::kVersion, team.threads(), format, 0});
  hdf5::send_mesh(mesh, to);
  to.flush();
  Incoming from = incoming(program);
  std::int64_t left = answer_of(from).bytes;
  for (std::vector<char> piece(std::size_t(1) << 18); left > 0 && !stopped;) {
    const std::span<char> part(piece.data(), std::size_t(std::min(left, std::int64_t(piece.size()))));
    from.get(part);
    stopped = !sink({part.data(), part.size()});
    left -= std::int64_t(part.size());
  }
}

}  // namespace

bool begins_like_hdf5(std::string_view bytes) {
  constexpr std::array kBegins = {"\x89HDF\r\n\x1a\n"sv, "CDF\x01"sv, "CDF\x02"sv, "CDF\x05"sv};
  return std::ranges::any_of(kBegins, [&](std::string_view begin) { return bytes.starts_with(begin); });
}

Expected<MeshFile> read_hdf5(std::string_view bytes, const Team& team) {
  const auto size = std::int64_t(bytes.size());
  FileAllowance allowance(bytes.size(), team.stop());
  try {
    Hdf5Process program(false, size, kProgramMemory + size + most_file_memory(size), team.stop());
    Outgoing to([&](std::string_view part) { program.send(part); });
    to.value(hdf5::Order{hdf5::kVersion, 1, Format::Auto, size});
    to.put(bytes);
    to.flush();
    Incoming from = incoming(program);
    const Format format = answer_of(from).format;
    if (format != Format::Hopr && format != Format::Cgns && format != Format::Exodus) throw Hdf5Failure{kWrongAnswer};
    MeshFile file{hdf5::receive_mesh(from, allowance), format};
    if (file.mesh.dimension < 2 || file.mesh.order < 1) throw Hdf5Failure{kWrongAnswer};
    return file;
  } catch (const Refusal& refusal) {
    throw ReadFailure{refusal.sentence};
  } catch (const Hdf5Failure& failure) {
    throw ReadFailure{"The mesh file cannot be read: " + failure.reason +
                      (failure.missing ? "." : "; write or copy it again, or convert it to MSH.")};
  }
}

Expected<void> write_hdf5(const HighOrderMesh& mesh, Format format, const Sink& sink, std::span<const CellField>,
                          const Team& team) {
  bool stopped = false;
  try {
    write(mesh, format, sink, team, stopped);
  } catch (const Refusal& refusal) {
    return bad_option(refusal.sentence);
  } catch (const Hdf5Failure& failure) {
    if (failure.missing) return bad_option("HDF5 files cannot be written: " + failure.reason + ".");
    return tl::unexpected<Error>({Error::Kind::Output, "The HDF5 file cannot be written: " + failure.reason + "."});
  }
  if (!stopped) return {};
  return tl::unexpected<Error>(
      {Error::Kind::Output, "Writing stopped before the end of the mesh; the disk may be full."});
}

}  // namespace varimesh::formats
