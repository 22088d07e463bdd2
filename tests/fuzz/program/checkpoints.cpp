// Checkpoints as the state of a run is read from them: a damaged one is refused, and one with a checksum that fits, as
// somebody could make it who knows how, is read in bounded memory. What was read is written with the same bytes.
//
// An input begins with a byte that says whether mark and checksum are made to fit.
#include "core/solvers/checkpoint.h"
#include "tests/fuzz/program/memory.h"

namespace {

using namespace varimesh;

/// That of a run on one triangle.
std::uint64_t fingerprint_of(double tolerance) {
  HighOrderMesh mesh;
  mesh.dimension = 2;
  mesh.order = 1;
  mesh.coordinates = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  ElementBlock block;
  block.shape = Shape::Triangle;
  block.order = 1;
  block.nodes = {0, 1, 2};
  mesh.blocks = {block};
  Options options;
  options.tolerance = tolerance;
  return fingerprint(mesh, {true, true, false}, {}, options);
}
const std::uint64_t kFingerprint = fingerprint_of(1e-3), kOther = fingerprint_of(1e-4);

enum class Kind : std::uint8_t { One, Two };

/// Numbers of all kinds that the state of a run has.
struct State {
  std::vector<double> positions;
  std::vector<char> flags;
  std::vector<std::int32_t> clocks;
  std::vector<std::vector<double>> parts;
  double energy = 0;
  std::int64_t fewest = 0;
  int number = 0;
  Kind kind = Kind::One;

  template <class Archive>
  void state(Archive& archive) {
    archive(positions, flags, energy, fewest, number, kind, clocks);
    auto count = static_cast<std::uint64_t>(parts.size());
    archive(count);
    for (std::uint64_t i = 0; i < count; ++i) {
      if constexpr (Archive::kReads) {
        if (archive.failed()) return;
        parts.emplace_back();
      }
      archive(parts[i]);
    }
  }
};

std::string written(State& state) {
  std::string bytes;
  CheckpointWriter writer(
      [&](std::string_view piece) {
        bytes += piece;
        return true;
      },
      kFingerprint);
  state.state(writer);
  fuzz::expect(writer.finish(), "a checkpoint cannot be written");
  return bytes;
}

/// The body between a mark, a fingerprint and a checksum that fit.
std::string around(std::string_view body) {
  State none;
  const std::string empty = written(none);
  // All checkpoints of a run begin with a line and a fingerprint.
  std::string bytes = empty.substr(0, empty.find('\n') + 1 + sizeof kFingerprint);
  bytes += body;
  // Inputs are shorter than one of the pieces that a checksum is made of.
  Fingerprint sum;
  sum.add(bytes);
  const std::uint64_t value = sum.value();
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  return bytes;
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  fuzz::count_memory();
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string_view rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  const std::string bytes = data[0] % 4 == 0 ? std::string(rest) : around(rest);
  State state;
  const bool failed = fuzz::within_memory(8 * static_cast<std::int64_t>(bytes.size()) + 4096, [&] {
    CheckpointReader reader(bytes, kFingerprint);
    if (!reader.failed()) state.state(reader);
    return reader.failed();
  });
  if (failed) return 0;
  const std::string again = written(state);
  fuzz::expect(again.size() <= bytes.size(), "more was written than was read");
  const std::size_t body = again.size() - sizeof(std::uint64_t);
  fuzz::expect(bytes.compare(0, body, again, 0, body) == 0, "writing what was read gives other bytes");
  CheckpointReader other(bytes, kOther);
  fuzz::expect(other.failed(), "a checkpoint of another run was taken");
  return 0;
}
