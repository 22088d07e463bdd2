#include "core/hdf/cgns/zones.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "core/base/io/scanner.h"
#include "core/formats/hdf5/notes.h"
#include "core/mesh/changes/serendipity_elements.h"

namespace varimesh::formats {

namespace {

class Joining {
 public:
  Joining(const std::vector<CgnsZone>& zones, HighOrderMesh& mesh, FileAllowance& allowance)
      : zones_(zones), mesh_(mesh), allowance_(allowance), same_(mesh.node_count()) {
    allowance_.take(same_.size(), sizeof(std::int32_t));
    std::iota(same_.begin(), same_.end(), 0);
    double low[3], high[3];
    for (std::size_t i = 0; i < mesh.coordinates.size(); ++i) {
      low[i % 3] = i < 3 ? mesh.coordinates[i] : std::min(low[i % 3], mesh.coordinates[i]);
      high[i % 3] = i < 3 ? mesh.coordinates[i] : std::max(high[i % 3], mesh.coordinates[i]);
    }
    for (int k = 0; k < 3; ++k) size_ = std::max(size_, high[k] - low[k]);
  }

  void join() {
    for (const CgnsZone& zone : zones_)
      for (const auto& [_, all] : cgns_children(zone.node, "ZoneGridConnectivity_t"))
        for (const auto& [name, node] : cgns_children(all, "GridConnectivity_t")) read(zone, node);
    leave_out_sides();
    renumber();
  }

 private:
  void read(const CgnsZone& zone, const Hdf5Group& node) {
    for (const auto& [_, property] : cgns_children(node, "GridConnectivityProperty_t"))
      if (!cgns_children(property, "Periodic_t").empty()) return;
    const bool has_type = node.find("GridConnectivityType") != nullptr;
    const std::string type = has_type ? cgns_text(node.group("GridConnectivityType")) : "Overset";
    if (type != "Abutting1to1")
      node.fail("", "joins zones by " + type.substr(0, 32) +
                        "; VariMesh joins zones whose nodes coincide, so write the connectivity as Abutting1to1");
    std::string donor_name = cgns_text(node);
    donor_name.erase(0, donor_name.rfind('/') + 1);
    const auto donor =
        std::find_if(zones_.begin(), zones_.end(), [&](const CgnsZone& z) { return z.name == donor_name; });
    if (donor == zones_.end()) node.fail("", "names the zone '" + donor_name.substr(0, 32) + "', which is not there");
    const bool by_nodes = cgns_location(node) == "Vertex";
    const std::vector<std::int64_t> own =
                                        points(node, by_nodes ? zone.nodes : zone.elements, "PointList", "PointRange"),
                                    its = points(node, by_nodes ? donor->nodes : donor->elements, "PointListDonor",
                                                 "PointRangeDonor");
    if (own.size() != its.size())
      node.fail("", "pairs " + std::to_string(own.size()) + " points with " + std::to_string(its.size()));
    for (std::size_t i = 0; i < own.size(); ++i) {
      if (by_nodes)
        pair(node, zone.first_node + own[i] - 1, donor->first_node + its[i] - 1, i);
      else
        pair_elements(node, zone.first_element + own[i], donor->first_element + its[i], i);
    }
    allowance_.give_back((own.size() + its.size()) * sizeof(std::int64_t));
  }

  std::vector<std::int64_t> points(const Hdf5Group& node, std::int64_t most, const char* list,
                                   const char* range) const {
    const char* name = node.find(list) != nullptr ? list : range;
    std::vector<std::int64_t> values = node.group(name).integers(kCgnsData);
    for (const std::int64_t value : values)
      if (value < 1 || value > most)
        node.fail(name, "has the number " + std::to_string(value) + ", but they go from 1 to " + std::to_string(most));
    if (name == list) return values;
    if (values.size() != 2 || values[1] < values[0]) node.fail(name, "is no range");
    const auto count = std::size_t(values[1] - values[0]) + 1;
    allowance_.take(count, sizeof(std::int64_t));
    std::vector<std::int64_t> all(count);
    std::iota(all.begin(), all.end(), values[0]);
    return all;
  }

  double gap(std::int64_t a, std::int64_t b) const {
    double most = 0;
    for (int k = 0; k < 3; ++k)
      most = std::max(most,
                      std::abs(mesh_.coordinates[std::size_t(3 * a + k)] - mesh_.coordinates[std::size_t(3 * b + k)]));
    return most;
  }

  void pair(const Hdf5Group& node, std::int64_t a, std::int64_t b, std::size_t row) {
    allowance_.look();
    constexpr double kOfSize = 1e-6;  // files may have single precision
    if (!(gap(a, b) <= kOfSize * size_))
      node.fail("", "pairs nodes at different places; if the boundary is periodic, the connectivity needs a Periodic_t",
                std::int64_t(row));
    const std::int32_t low = std::min(root(std::int32_t(a)), root(std::int32_t(b)));
    const std::int32_t high = std::max(root(std::int32_t(a)), root(std::int32_t(b)));
    same_[std::size_t(high)] = low;
  }

  std::int32_t root(std::int32_t node) {
    while (same_[std::size_t(node)] != node)
      node = same_[std::size_t(node)] = same_[std::size_t(same_[std::size_t(node)])];
    return node;
  }

  /// The nodes of a side by its number.
  std::span<const std::int32_t> side(const Hdf5Group& node, std::int64_t number, std::size_t row) const {
    const auto begins_after = [](std::int64_t n, const ElementBlock& block) { return n < block.numbers.front(); };
    const auto after = std::upper_bound(mesh_.blocks.begin(), mesh_.blocks.end(), number, begins_after);
    const ElementBlock* block = after == mesh_.blocks.begin() ? nullptr : &*std::prev(after);
    if (block == nullptr || number > block->numbers.back() ||
        reference::info(block->shape).dimension != mesh_.dimension - 1)
      node.fail("", "pairs an element that is no side", std::int64_t(row));
    const std::size_t count = nodes_per_element(*block);
    return {block->nodes.data() + std::size_t(number - block->numbers.front()) * count, count};
  }

  /// Pairs the nodes of two sides by their places.
  void pair_elements(const Hdf5Group& node, std::int64_t a, std::int64_t b, std::size_t row) {
    const auto own = side(node, a, row), its = side(node, b, row);
    if (own.size() != its.size()) node.fail("", "pairs sides of different shapes or orders", std::int64_t(row));
    for (const std::int32_t each : own)
      pair(node, each,
           *std::min_element(its.begin(), its.end(), [&](auto x, auto y) { return gap(each, x) < gap(each, y); }), row);
  }

  /// Sides between two zones are in files for their connectivity, and would be interfaces of the mesh.
  void leave_out_sides() {
    std::vector<bool> joined(same_.size(), false);
    for (std::size_t node = 0; node < same_.size(); ++node)
      if (const auto low = std::size_t(root(std::int32_t(node))); low != node) joined[low] = joined[node] = true;
    for (ElementBlock& block : mesh_.blocks) {
      if (reference::info(block.shape).dimension != mesh_.dimension - 1 || !block.physical.empty()) continue;
      const std::size_t count = nodes_per_element(block);
      std::size_t kept = 0;
      for (std::size_t e = 0; e < block.size(); ++e) {
        const auto* const nodes = block.nodes.data() + e * count;
        if (std::all_of(nodes, nodes + count, [&](std::int32_t n) { return joined[std::size_t(n)]; })) continue;
        std::copy_n(nodes, count, block.nodes.data() + kept * count);
        block.numbers[kept++] = block.numbers[e];
      }
      block.numbers.resize(kept);
      block.nodes.resize(kept * count);
    }
    std::erase_if(mesh_.blocks, [](const ElementBlock& block) { return block.size() == 0; });
  }

  void renumber() {
    std::vector<std::int32_t> fresh(same_.size());
    allowance_.take(fresh.size(), sizeof(std::int32_t));
    std::int32_t next = 0;
    for (std::size_t node = 0; node < same_.size(); ++node) {
      const std::int32_t low = root(std::int32_t(node));
      if (low < std::int32_t(node)) {
        fresh[node] = fresh[std::size_t(low)];
        continue;
      }
      std::copy_n(mesh_.coordinates.begin() + 3 * std::ptrdiff_t(node), 3,
                  mesh_.coordinates.begin() + 3 * std::ptrdiff_t(next));
      fresh[node] = next++;
    }
    mesh_.coordinates.resize(3 * std::size_t(next));
    mesh_.node_numbers.resize(std::size_t(next));
    mesh_.node_blocks = {{-1, 0, 0, next}};
    for (ElementBlock& block : mesh_.blocks)
      for (std::int32_t& node : block.nodes) node = fresh[std::size_t(node)];
  }

  const std::vector<CgnsZone>& zones_;
  HighOrderMesh& mesh_;
  FileAllowance& allowance_;
  std::vector<std::int32_t> same_;  // a lower node that is the same, or the node itself
  double size_ = 0;
};

}  // namespace

void join_cgns_zones(const std::vector<CgnsZone>& zones, HighOrderMesh& mesh, FileAllowance& allowance) {
  Joining(zones, mesh, allowance).join();
  mesh.foreign.push_back({kCgnsZones, std::to_string(zones.size()), "cgns"});
}

}  // namespace varimesh::formats
