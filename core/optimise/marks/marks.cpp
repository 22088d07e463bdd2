// Measures the cells, and divides blocks so that unrepairable cells have blocks of their own.
#include "core/optimise/marks/marks.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "core/base/team.h"
#include "core/quality/certified_quality.h"
#include "core/quality/surface.h"

namespace varimesh {
namespace {

constexpr const char* kName = "unrepairable";

/// An empty block of the same shape, order, entity and groups.
ElementBlock empty_like(const ElementBlock& block) {
  ElementBlock empty;
  empty.shape = block.shape;
  empty.order = block.order;
  empty.entity = block.entity;
  empty.physical = block.physical;
  empty.partitions = block.partitions;
  return empty;
}

/// Copies one element to the end of another block.
void append(const ElementBlock& from, std::size_t element, ElementBlock& to) {
  const std::size_t nodes = static_cast<std::size_t>(reference::node_count(from.shape, from.order));
  to.numbers.push_back(from.numbers[element]);
  to.nodes.insert(to.nodes.end(), from.nodes.begin() + static_cast<std::ptrdiff_t>(element * nodes),
                  from.nodes.begin() + static_cast<std::ptrdiff_t>((element + 1) * nodes));
  const std::size_t repeats = from.repeat_numbers.size() / from.size();
  for (std::size_t r = 0; r < repeats; ++r) to.repeat_numbers.push_back(from.repeat_numbers[element * repeats + r]);
}

class Marker {
 public:
  Marker(HighOrderMesh& mesh, std::span<const UnrepairableGroup> groups)
      : mesh_(mesh), marked_(mesh.element_count(mesh.dimension), false) {
    for (const UnrepairableGroup& group : groups)
      for (const std::int32_t cell : group.cells) marked_[static_cast<std::size_t>(cell)] = true;
    remove_former();
    for (const PhysicalGroup& group : mesh.physical_groups) tag_ = std::max(tag_, group.tag + 1);
    for (const ElementBlock& block : mesh.blocks)
      for (const int tag : block.physical) tag_ = std::max(tag_, tag + 1);
    for (const ElementBlock& block : mesh.blocks)
      if (is_cell(block)) next_entity_ = std::max(next_entity_, block.entity + 1);
    for (const Entity& entity : mesh.entities)
      if (entity.dimension == mesh.dimension) next_entity_ = std::max(next_entity_, entity.tag + 1);
  }

  std::vector<std::int32_t> mark() {
    std::vector<ElementBlock> blocks;
    std::vector<std::int32_t> order;
    std::size_t first = 0;
    for (ElementBlock& block : mesh_.blocks) {
      if (!is_cell(block)) {
        blocks.push_back(std::move(block));
        continue;
      }
      ElementBlock rest = empty_like(block), marked = empty_like(block);
      for (std::size_t e = 0; e < block.size(); ++e) append(block, e, marked_[first + e] ? marked : rest);
      for (const bool is_marked : {false, true})
        for (std::size_t e = first; e < first + block.size(); ++e)
          if (marked_[e] == is_marked) order.push_back(static_cast<std::int32_t>(e));
      first += block.size();
      if (rest.size() > 0) blocks.push_back(std::move(rest));
      if (marked.size() == 0) continue;
      marked.entity = entity_for(block.entity);
      marked.physical.push_back(tag_);
      if (marked.physical.size() > 1) marked.repeat_numbers.clear();  // formats that need them give new ones
      blocks.push_back(std::move(marked));
    }
    mesh_.blocks = std::move(blocks);
    mesh_.physical_groups.push_back({mesh_.dimension, tag_, kName});
    return order;
  }

 private:
  /// Removes the group from an earlier call, which a mesh has if it was written and read again.
  void remove_former() {
    const auto is_former = [&](const PhysicalGroup& group) {
      return group.dimension == mesh_.dimension && group.name == kName;
    };
    for (const PhysicalGroup& group : mesh_.physical_groups) {
      if (!is_former(group)) continue;
      for (ElementBlock& block : mesh_.blocks) {
        if (reference::info(block.shape).dimension != mesh_.dimension || std::erase(block.physical, group.tag) == 0)
          continue;
        block.repeat_numbers.clear();
      }
      for (Entity& entity : mesh_.entities)
        if (entity.dimension == mesh_.dimension) std::erase(entity.physical, group.tag);
    }
    std::erase_if(mesh_.physical_groups, is_former);
  }

  bool is_cell(const ElementBlock& block) const {
    return block.size() > 0 && reference::info(block.shape).dimension == mesh_.dimension;
  }

  /// The tag of an entity that is like `original` and also in the new physical group. Makes one per original.
  int entity_for(int original) {
    const auto [found, is_new] = entities_.emplace(original, next_entity_);
    if (!is_new) return found->second;
    ++next_entity_;
    for (std::size_t i = 0; i < mesh_.entities.size(); ++i) {
      if (mesh_.entities[i].dimension != mesh_.dimension || mesh_.entities[i].tag != original) continue;
      Entity copy = mesh_.entities[i];
      copy.tag = found->second;
      copy.physical.push_back(tag_);
      mesh_.entities.insert(mesh_.entities.begin() + static_cast<std::ptrdiff_t>(i) + 1, std::move(copy));
      break;
    }
    return found->second;
  }

  HighOrderMesh& mesh_;
  std::vector<bool> marked_;
  int tag_ = 1, next_entity_ = 1;
  std::map<int, int> entities_;
};

}  // namespace

CellMarks::CellMarks(const HighOrderMesh& mesh, std::span<const UnrepairableGroup> groups, int threads,
                     std::span<const double> thickness)
    : unrepairable_(mesh.element_count(mesh.dimension), 0.0), thickness_(thickness) {
  const Team team(threads);
  std::optional<detail::JudgedMesh> judged;
  std::vector<Certificate> certificates;
  team.run([&] {
    judged.emplace(mesh, team);
    const Certifier certifier(judged->mesh(), CertificateOptions{}, team);
    certificates.resize(certifier.cells());
    certifier.certify(judged->mesh().coordinates, certificates, team);
  });
  CellQuality quality = cell_quality(judged->mesh(), team);
  scaled_jacobian_ = std::move(quality.scaled_jacobian);
  distortion_jacobian_ = std::move(quality.distortion_jacobian);
  if (judged->surface() == nullptr || judged->surface()->is_plane())
    accuracy_loss_ = cell_accuracy(judged->mesh(), threads).loss;
  for (const Certificate& certificate : certificates)
    certified_.push_back(certificate.is_valid() ? 1 : certificate.answer == Certificate::Answer::Invalid ? -1 : 0);
  for (std::size_t g = groups.size(); g-- > 0;)
    for (const std::int32_t cell : groups[g].cells)
      unrepairable_[static_cast<std::size_t>(cell)] = static_cast<double>(g + 1);
}

std::vector<formats::CellField> CellMarks::fields() const {
  std::vector<formats::CellField> fields = {{"scaled_jacobian", scaled_jacobian_},
                                            {"distortion_jacobian", distortion_jacobian_},
                                            {"certified", certified_},
                                            {"unrepairable", unrepairable_}};
  if (!accuracy_loss_.empty()) fields.push_back({"accuracy_loss", accuracy_loss_});
  if (!thickness_.empty()) fields.push_back(thickness_field(thickness_));
  return fields;
}

formats::CellField thickness_field(std::span<const double> thickness) { return {"layer_thickness_share", thickness}; }

std::vector<std::int32_t> mark_unrepairable(HighOrderMesh& mesh, std::span<const UnrepairableGroup> groups) {
  if (!groups.empty()) return Marker(mesh, groups).mark();
  std::vector<std::int32_t> as_they_were(mesh.element_count(mesh.dimension));
  std::iota(as_they_were.begin(), as_they_were.end(), 0);
  return as_they_were;
}

}  // namespace varimesh
