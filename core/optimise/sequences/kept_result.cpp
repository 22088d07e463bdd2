#include "core/optimise/sequences/kept_result.h"

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/mesh/node_parameters.h"
#include "core/optimise/iteration_state.h"
#include "core/solvers/checkpoint.h"

namespace varimesh {
namespace {

constexpr std::uint64_t kFingerprint = 0;  // the checkpoint around the bytes has one

template <class Archive>
void state(Archive& archive, std::string& text) {
  std::vector<char> bytes(text.begin(), text.end());
  archive(bytes);
  if constexpr (Archive::kReads) text.assign(bytes.begin(), bytes.end());
}

template <class Archive, class T, std::size_t n>
void state(Archive& archive, std::array<T, n>& values) {
  for (T& value : values) archive(value);
}

template <class Archive>
void state(Archive& archive, InvalidElement& element) {
  archive(element.number, element.scaled_jacobian);
  state(archive, element.place);
}

template <class Archive>
void state(Archive& archive, UncertifiedElement& element) {
  archive(element.number, element.answer);
  state(archive, element.place);
}

template <class Archive>
void state(Archive& archive, UnrepairableGroup& group) {
  archive(group.kind, group.vertex, group.elements, group.cells, group.determinant);
  state(archive, group.place);
  state(archive, group.sentence);
}

template <class Archive>
void state(Archive& archive, RepairStep& step) {
  archive(step.kind, step.vertices, step.node, step.elements, step.new_elements);
  state(archive, step.sentence);
}

template <class Archive>
void state(Archive& archive, Iteration& iteration) {
  iteration_state(archive, iteration);
  archive(iteration.groups_left);
}

/// A list of things that have a state() each.
template <class Archive, class T>
void list_state(Archive& archive, std::vector<T>& list) {
  std::uint64_t size = list.size();
  archive(size);
  for (std::uint64_t i = 0; i < size; ++i) {
    if constexpr (Archive::kReads) {
      if (archive.failed()) return;
      list.emplace_back();
    }
    state(archive, list[i]);
  }
}

/// Keeps whether there is a value, and makes one to read into.
template <class Archive, class T>
bool has_value(Archive& archive, std::optional<T>& maybe) {
  bool has = maybe.has_value();
  archive(has);
  if (has && !maybe) maybe.emplace();
  return has;
}

template <class Archive>
void state(Archive& archive, QualityReport& report) {
  CertificateSummary& certified = report.certified;
  archive(report.min_scaled_jacobian, report.mean_scaled_jacobian, report.min_distortion_jacobian,
          report.invalid_elements, report.lattice_intervals, certified.valid, certified.invalid, certified.undecided,
          certified.min_scaled_jacobian_lower_bound, report.clockwise, report.is_surface);
  state(archive, report.histogram);
  list_state(archive, report.invalid);
  list_state(archive, report.uncertified);
  if (has_value(archive, report.accuracy)) archive(report.accuracy->loss, report.accuracy->modal_parts);
  if (has_value(archive, report.in_layers))
    archive(report.in_layers->error, report.in_layers->cells, report.in_layers->of_profiles);
}

template <class Archive>
void state(Archive& archive, Result& result) {
  MeshSummary& sizes = result.sizes;
  archive(sizes.dimension, sizes.order, sizes.elements, sizes.nodes, sizes.free_nodes);
  archive(result.iterations, result.proof_seconds, result.residual, result.converged, result.stopped,
          result.stop_reason, result.mesh.coordinates, result.substitute_targets.elements);
  state(archive, result.substitute_targets.sentence);
  state(archive, result.kept_as_it_came);
  state(archive, result.device);
  state(archive, result.after);
  list_state(archive, result.unrepairable);
  list_state(archive, result.repairs);
  list_state(archive, result.notes);
  list_state(archive, result.history);
}

}  // namespace

std::vector<char> keep_result(std::optional<Result>& result) {
  std::vector<char> bytes;
  CheckpointWriter writer(
      [&](std::string_view part) {
        bytes.insert(bytes.end(), part.begin(), part.end());
        return true;
      },
      kFingerprint);
  const bool is_refused = !result;
  writer(is_refused);
  if (result) state(writer, *result);
  writer.finish();
  return bytes;
}

bool take_kept(const std::vector<char>& bytes, const HighOrderMesh& mesh, std::optional<Result>& result) {
  CheckpointReader reader({bytes.data(), bytes.size()}, kFingerprint);
  bool is_refused = false;
  reader(is_refused);
  Result kept;
  if (!is_refused) state(reader, kept);
  const bool fits = is_refused || kept.mesh.coordinates.size() == mesh.coordinates.size();
  if (reader.failed() || !fits) return false;
  result.reset();
  if (is_refused) return true;
  std::vector<double> coordinates = std::move(kept.mesh.coordinates);
  kept.mesh = mesh;
  const NodesWithParameters with_parameters(mesh);
  kept.mesh.coordinates = std::move(coordinates);
  with_parameters.forget_moved(kept.mesh);
  result = std::move(kept);
  return true;
}

}  // namespace varimesh
