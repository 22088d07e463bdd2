// Classifies a mesh on entities, and makes entities for a mesh whose file had none.
#include "core/formats/gmsh/entities.h"

#include <algorithm>
#include <limits>
#include <map>
#include <set>

#include "core/base/shared_work.h"

namespace varimesh::formats {

namespace {

constexpr std::size_t kIndicesPerTask = 65536;

using Key = std::pair<int, int>;  // dimension, tag

int dimension_of(const ElementBlock& block) { return reference::info(block.shape).dimension; }

void extend_box(Entity& entity, const HighOrderMesh& mesh, const ElementBlock& block) {
  for (std::int32_t node : block.nodes)
    for (std::size_t k = 0; k < 3; ++k) {
      const double x = mesh.coordinates[3 * std::size_t(node) + k];
      entity.box[k] = std::min(entity.box[k], x);
      entity.box[k + 3] = std::max(entity.box[k + 3], x);
    }
}

// A tag above all others, or if there is no larger number, the first that nothing has.
int free_tag(int dimension, int& largest, const std::set<Key>& taken) {
  if (largest < std::numeric_limits<int>::max()) return ++largest;
  int tag = 1;
  while (taken.contains({dimension, tag})) ++tag;
  return tag;
}

// Gives each block an entity that has the block's physical groups. Makes a new entity if there is none.
void assign_entities(const HighOrderMesh& mesh, Classification& result) {
  std::map<Key, std::size_t> listed;
  std::map<int, int> largest;
  for (std::size_t i = 0; i < result.entities.size(); ++i)
    listed[{result.entities[i].dimension, result.entities[i].tag}] = i;
  for (const Entity& entity : result.entities)
    largest[entity.dimension] = std::max(largest[entity.dimension], entity.tag);
  std::set<Key> taken;
  for (const auto& [key, place] : listed) taken.insert(key);
  for (const ElementBlock& block : mesh.blocks) {
    largest[dimension_of(block)] = std::max(largest[dimension_of(block)], block.entity);
    taken.insert({dimension_of(block), block.entity});
  }

  std::map<std::pair<Key, std::vector<int>>, std::size_t> chosen;
  std::vector<bool> made(result.entities.size(), false);
  for (const ElementBlock& block : mesh.blocks) {
    const int d = dimension_of(block);
    const Key key{d, block.entity};
    auto [at, is_new] = chosen.try_emplace({key, block.physical}, 0);
    if (is_new) {
      const auto known = listed.find(key);
      if (known != listed.end() && result.entities[known->second].physical == block.physical) {
        at->second = known->second;
      } else {
        const int tag = known == listed.end() && block.entity > 0 ? block.entity : free_tag(d, largest[d], taken);
        taken.insert({d, tag});
        constexpr double kFar = std::numeric_limits<double>::max();
        result.entities.push_back({d, tag, {kFar, kFar, kFar, -kFar, -kFar, -kFar}, block.physical, {}});
        made.push_back(true);
        at->second = result.entities.size() - 1;
        listed.try_emplace(key, at->second);
      }
    }
    if (made[at->second]) extend_box(result.entities[at->second], mesh, block);
    result.block_entity.push_back(result.entities[at->second].tag);
  }
}

// Classifies each node on the entity of lowest dimension, then lowest tag, that has an element with this node. A node
// without elements belongs to the first entity of the highest dimension.
void classify_nodes(const HighOrderMesh& mesh, Classification& result, const Team& team) {
  std::map<Key, std::int32_t> rank;
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) rank[{dimension_of(mesh.blocks[b]), result.block_entity[b]}] = 0;
  std::vector<Key> keys;
  for (auto& [key, position] : rank) {
    position = std::int32_t(keys.size());
    keys.push_back(key);
  }
  if (keys.empty()) keys.push_back({3, 1});
  std::int32_t orphans = 0;
  while (keys[std::size_t(orphans)].first != keys.back().first) ++orphans;

  std::vector<std::int32_t> owner(mesh.node_count(), std::numeric_limits<std::int32_t>::max());
  for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
    const std::int32_t position = rank[{dimension_of(mesh.blocks[b]), result.block_entity[b]}];
    const std::vector<std::int32_t>& nodes = mesh.blocks[b].nodes;
    team.for_ranges(nodes.size(), kIndicesPerTask, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) lower_to(owner[std::size_t(nodes[i])], position, team);
    });
  }
  std::vector<std::int32_t> start(keys.size() + 1, 0);
  for (std::int32_t& position : owner) {
    if (position == std::numeric_limits<std::int32_t>::max()) position = orphans;
    ++start[std::size_t(position) + 1];
  }
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (start[i + 1] > 0) result.node_blocks.push_back({keys[i].first, keys[i].second, start[i], start[i + 1]});
    start[i + 1] += start[i];
  }
  result.node_order.resize(owner.size());
  for (std::size_t node = 0; node < owner.size(); ++node)
    result.node_order[std::size_t(start[std::size_t(owner[node])]++)] = std::int32_t(node);
}

}  // namespace

Classification classify_on_entities(const HighOrderMesh& mesh, bool keep_entities, const Team& team) {
  Classification result;
  result.entities = mesh.entities;
  if (keep_entities)
    for (const ElementBlock& block : mesh.blocks) result.block_entity.push_back(block.entity);
  else
    assign_entities(mesh, result);
  const bool classified = std::all_of(mesh.node_blocks.begin(), mesh.node_blocks.end(),
                                      [](const NodeBlock& block) { return block.dimension >= 0; });
  std::int64_t covered = 0;
  for (const NodeBlock& block : mesh.node_blocks) covered += block.count;
  if (classified && covered == std::int64_t(mesh.node_count()))
    result.node_blocks = mesh.node_blocks;
  else
    classify_nodes(mesh, result, team);
  return result;
}

}  // namespace varimesh::formats
