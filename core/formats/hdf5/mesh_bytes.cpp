#include "core/formats/hdf5/mesh_bytes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "core/formats/common/format.h"
#include "core/reference/serendipity.h"

namespace varimesh::formats::hdf5 {

namespace {

class Out {
 public:
  explicit Out(Outgoing& to) : to_(to) {}

  template <class... T>
  void values(T&... all) {
    (to_.value(all), ...);
  }
  template <class List>
  void list(List& all) {
    using T = typename std::remove_const_t<List>::value_type;
    to_.value(std::uint64_t(all.size()));
    to_.put({reinterpret_cast<const char*>(all.data()), all.size() * sizeof(T)});
    if constexpr (!std::is_const_v<List>) List().swap(all);
  }
  template <class List, class Body>
  void each(List& all, const Body& body) {
    to_.value(std::uint64_t(all.size()));
    for (auto& one : all) body(one);
  }

 private:
  Outgoing& to_;
};

class In {
 public:
  In(Incoming& from, FileAllowance& allowance) : from_(from), allowance_(allowance) {}

  template <class... T>
  void values(T&... all) {
    ((all = from_.value<T>()), ...);
  }
  template <class List>
  void list(List& all) {
    const std::size_t count = room(sizeof(typename List::value_type));
    all.resize(count);
    from_.get({reinterpret_cast<char*>(all.data()), count * sizeof(typename List::value_type)});
  }
  template <class List, class Body>
  void each(List& all, const Body& body) {
    const std::size_t count = room(sizeof(typename List::value_type));
    all.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      allowance_.look();
      body(all.emplace_back());
    }
  }

 private:
  /// The number of elements that follow, whose memory is counted.
  std::size_t room(std::size_t bytes_each) {
    const auto count = from_.value<std::uint64_t>();
    allowance_.take(count, bytes_each);
    if (count > 0) allowance_.take(1, kAllocation);
    return count;
  }

  Incoming& from_;
  FileAllowance& allowance_;
};

/// All that a mesh consists of, in the order in which it is sent. Mesh: HighOrderMesh, const if it is kept.
template <class Io, class Mesh>
void pass(Io& io, Mesh& mesh) {
  io.values(mesh.dimension, mesh.order);
  io.list(mesh.coordinates);
  io.list(mesh.node_numbers);
  io.each(mesh.node_blocks, [&](auto& block) {
    io.values(block.dimension, block.entity, block.first, block.count);
    io.list(block.parameters);
  });
  io.each(mesh.blocks, [&](auto& block) {
    io.values(block.shape, block.order, block.entity);
    io.list(block.physical);
    io.list(block.numbers);
    io.list(block.nodes);
    io.list(block.partitions);
    io.list(block.repeat_numbers);
  });
  io.each(mesh.entities, [&](auto& entity) {
    io.values(entity.dimension, entity.tag, entity.box);
    io.list(entity.physical);
    io.list(entity.boundary);
  });
  io.each(mesh.physical_groups, [&](auto& group) {
    io.values(group.dimension, group.tag);
    io.list(group.name);
  });
  io.each(mesh.periodic, [&](auto& link) {
    io.values(link.dimension, link.entity, link.master);
    io.list(link.affine);
    io.list(link.nodes);
  });
  io.each(mesh.foreign, [&](auto& section) {
    io.list(section.name);
    io.list(section.bytes);
    io.list(section.format);
  });
}

// === Whether a mesh is whole =============================================================================

bool is_dimension(int dimension) { return dimension >= 0 && dimension <= 3; }

bool are_finite(const std::vector<double>& values) {
  return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
}

/// Tags are negated and made positive.
bool are_tags(const std::vector<int>& tags) {
  return std::find(tags.begin(), tags.end(), std::numeric_limits<int>::min()) == tags.end();
}

/// Positive, and each once.
bool are_numbers(const std::vector<std::int64_t>& numbers) {
  if (std::any_of(numbers.begin(), numbers.end(), [](std::int64_t number) { return number < 1; })) return false;
  const auto unlike = [](const auto& list) { return std::adjacent_find(list.begin(), list.end()) == list.end(); };
  if (std::is_sorted(numbers.begin(), numbers.end())) return unlike(numbers);
  std::vector<std::int64_t> sorted = numbers;
  std::sort(sorted.begin(), sorted.end());
  return unlike(sorted);
}

bool is_whole(const HighOrderMesh& mesh, const NodeBlock& block, std::int64_t covered) {
  return block.first == covered && block.count >= 0 && block.count <= std::int64_t(mesh.node_count()) - covered &&
         block.dimension >= -1 && block.dimension <= 3 &&
         (block.parameters.empty() ||
          (block.dimension > 0 && block.parameters.size() == std::size_t(block.dimension) * std::size_t(block.count)));
}

bool is_whole(const HighOrderMesh& mesh, const ElementBlock& block) {
  if (int(block.shape) >= kShapes || block.order < 1 || block.order > kMaxOrder) return false;
  if (reference::info(block.shape).dimension > mesh.dimension) return false;
  const auto is_node = [&](std::int32_t node) { return node >= 0 && std::size_t(node) < mesh.node_count(); };
  const std::size_t repeats = block.physical.empty() ? 0 : block.physical.size() - 1;
  const auto has = [&](int nodes) { return nodes > 0 && block.nodes.size() == block.size() * std::size_t(nodes); };
  return (has(reference::node_count(block.shape, block.order)) ||
          has(reference::serendipity_node_count(block.shape, block.order))) &&
         std::all_of(block.nodes.begin(), block.nodes.end(), is_node) && are_tags(block.physical) &&
         block.entity != std::numeric_limits<int>::min() &&
         std::all_of(block.numbers.begin(), block.numbers.end(), [](std::int64_t number) { return number > 0; }) &&
         (block.repeat_numbers.empty() || block.repeat_numbers.size() == repeats * block.size());
}

bool is_whole(const HighOrderMesh& mesh, const PeriodicLink& link) {
  const auto is_node = [&](std::int32_t node) { return node >= 0 && std::size_t(node) < mesh.node_count(); };
  return is_dimension(link.dimension) && (link.affine.empty() || link.affine.size() == 16) && are_finite(link.affine) &&
         std::all_of(link.nodes.begin(), link.nodes.end(),
                     [&](const auto& pair) { return is_node(pair.first) && is_node(pair.second); });
}

bool is_whole(const HighOrderMesh& mesh) {
  if (!is_dimension(mesh.dimension) || mesh.order < 0 || mesh.order > kMaxOrder) return false;
  if (mesh.coordinates.size() % 3 != 0 || std::int64_t(mesh.node_count()) > kMostNodes) return false;
  if (!are_finite(mesh.coordinates)) return false;
  if (mesh.node_numbers.size() != mesh.node_count() || !are_numbers(mesh.node_numbers)) return false;
  std::int64_t covered = 0, elements = 0;
  for (const NodeBlock& block : mesh.node_blocks) {
    if (!is_whole(mesh, block, covered)) return false;
    covered += block.count;
  }
  if (covered != std::int64_t(mesh.node_count())) return false;
  for (const ElementBlock& block : mesh.blocks) {
    if (!is_whole(mesh, block)) return false;
    elements += std::int64_t(block.size());
  }
  const auto all = [](const auto& list, const auto& holds) { return std::all_of(list.begin(), list.end(), holds); };
  return elements <= kMostNodes && std::int64_t(mesh.element_count(mesh.dimension)) <= kMostCells &&
         all(mesh.entities,
             [](const Entity& entity) {
               return is_dimension(entity.dimension) && are_tags({entity.tag}) && are_tags(entity.physical) &&
                      are_tags(entity.boundary);
             }) &&
         all(mesh.physical_groups,
             [](const PhysicalGroup& group) { return is_dimension(group.dimension) && are_tags({group.tag}); }) &&
         all(mesh.periodic, [&](const PeriodicLink& link) { return is_whole(mesh, link); }) &&
         // A note of another format would be written to files of that format as it is.
         all(mesh.foreign, [](const ForeignSection& section) {
           return section.format == format_name(Format::Hopr) || section.format == format_name(Format::Cgns);
         });
}

}  // namespace

void send_mesh(const HighOrderMesh& mesh, Outgoing& to) {
  Out out(to);
  pass(out, mesh);
}

void send_mesh(HighOrderMesh&& mesh, Outgoing& to) {
  Out out(to);
  pass(out, mesh);
}

HighOrderMesh receive_trusted_mesh(Incoming& from, FileAllowance& allowance) {
  HighOrderMesh mesh;
  In in(from, allowance);
  pass(in, mesh);
  return mesh;
}

HighOrderMesh receive_mesh(Incoming& from, FileAllowance& allowance) {
  HighOrderMesh mesh = receive_trusted_mesh(from, allowance);
  if (!is_whole(mesh))
    throw ReadFailure{
        "The mesh file cannot be read: the program for HDF5 gave a mesh that is not whole, so the file is probably "
        "damaged; write or copy it again, or convert it to MSH."};
  return mesh;
}

}  // namespace varimesh::formats::hdf5
