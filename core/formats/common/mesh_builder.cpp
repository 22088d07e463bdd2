#include "core/formats/common/mesh_builder.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/reference/nodes.h"

namespace varimesh::formats {

namespace {

[[noreturn]] void fail(const std::string& what) { throw ReadFailure{"The mesh file cannot be read: " + what + "."}; }

std::string as_text(std::int64_t number) { return std::to_string(number); }

}  // namespace

void MeshBuilder::add_node(std::int64_t number, const std::array<double, 3>& at) {
  if (number < 1) fail("a node has the number " + as_text(number) + "; numbers begin with 1");
  if (mesh_.node_count() >= std::size_t(kMostNodes)) fail("it has more nodes than VariMesh takes");
  for (const double x : at)
    if (!std::isfinite(x)) fail("node " + as_text(number) + kNotFinite);
  allowance_.make_room(mesh_.coordinates, 3);
  allowance_.make_room(mesh_.node_numbers, 1);
  mesh_.coordinates.insert(mesh_.coordinates.end(), at.begin(), at.end());
  mesh_.node_numbers.push_back(number);
  ascending_ = ascending_ && number == std::int64_t(mesh_.node_numbers.size());
}

std::size_t MeshBuilder::add_element(Shape shape, int order, std::span<const std::int64_t> nodes, std::int64_t number) {
  if (elements_.size() >= std::size_t(kMostCells)) fail("it has more elements than VariMesh takes");
  allowance_.make_room(elements_, 1);
  allowance_.make_room(nodes_, nodes.size());
  elements_.push_back({shape, std::uint8_t(order), std::int32_t(nodes.size()), 0, number, nodes_.size()});
  nodes_.insert(nodes_.end(), nodes.begin(), nodes.end());
  return elements_.size() - 1;
}

std::size_t MeshBuilder::add_side(std::size_t element, int facet) {
  const Element of = elements_[element];
  const reference::Facet& side = reference::info(of.shape).facets[std::size_t(facet)];
  std::vector<std::int64_t> nodes;
  for (const int local : reference::facet_nodes(of.shape, of.order, facet))
    if (local < of.count) nodes.push_back(nodes_of(element)[std::size_t(local)]);
  std::array<std::int64_t, 4> vertices{};
  std::copy_n(nodes.begin(), reference::info(side.shape).vertices, vertices.begin());
  std::sort(vertices.begin(), vertices.end());
  allowance_.take(1, kTreeNode);
  const auto [at, is_new] = sides_.try_emplace(vertices, elements_.size());
  if (is_new) add_element(side.shape, of.order, nodes, 0);
  return at->second;
}

void MeshBuilder::put_into_group(std::size_t element, int tag) {
  std::int32_t& own = elements_[element].groups;
  const std::vector<int>& now = lists_[std::size_t(own)];
  if (std::find(now.begin(), now.end(), tag) != now.end()) return;
  const auto [at, is_new] = longer_lists_.try_emplace({own, tag}, std::int32_t(lists_.size()));
  if (is_new) {
    allowance_.take(2, kTreeNode + (now.size() + 1) * sizeof(int));
    std::vector<int> longer = now;
    longer.push_back(tag);
    lists_.push_back(std::move(longer));
  }
  own = at->second;
}

void MeshBuilder::name_group(int dimension, int tag, std::string name) {
  allowance_.take(1, 2 * (sizeof(PhysicalGroup) + name.size()));
  names_.push_back({dimension, tag, std::move(name)});
}

void MeshBuilder::number_elements() {
  std::vector<std::int64_t> all;
  allowance_.take(elements_.size(), sizeof(std::int64_t));
  all.reserve(elements_.size());
  for (const Element& element : elements_)
    if (element.number != 0) all.push_back(element.number);
  std::sort(all.begin(), all.end());
  if (const auto twice = std::adjacent_find(all.begin(), all.end()); twice != all.end())
    fail("two elements have the number " + as_text(*twice) + "; number the elements of all parts in one sequence");
  std::int64_t last = all.empty() ? 0 : all.back();
  for (Element& element : elements_)
    if (element.number == 0) element.number = ++last;
  allowance_.give_back(elements_.size() * sizeof(std::int64_t));
}

void MeshBuilder::check_node_numbers() {
  if (ascending_) return;
  const std::vector<std::int64_t>& numbers = mesh_.node_numbers;
  allowance_.take(numbers.size(), sizeof by_number_[0]);
  by_number_.reserve(numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) by_number_.emplace_back(numbers[i], std::int32_t(i));
  std::sort(by_number_.begin(), by_number_.end());
  const auto twice = std::adjacent_find(by_number_.begin(), by_number_.end(),
                                        [](const auto& a, const auto& b) { return a.first == b.first; });
  if (twice != by_number_.end())
    fail("two nodes have the number " + as_text(twice->first) + "; number the nodes of all parts in one sequence");
}

std::int32_t MeshBuilder::index_of(std::int64_t number, const Element& element) const {
  if (ascending_) {
    if (number >= 1 && number <= std::int64_t(mesh_.node_count())) return std::int32_t(number - 1);
  } else {
    const auto found = std::lower_bound(by_number_.begin(), by_number_.end(), std::pair(number, std::int32_t(0)));
    if (found != by_number_.end() && found->first == number) return found->second;
  }
  fail("element " + as_text(element.number) + " has the node " + as_text(number) + ", which the file does not list");
}

void MeshBuilder::add_to_block(const Element& element) {
  const std::array<int, 3> kind = {int(element.shape), element.count, element.groups};
  const auto [at, is_new] = blocks_.try_emplace(kind, mesh_.blocks.size());
  if (is_new) {
    const std::vector<int>& groups = lists_[std::size_t(element.groups)];
    allowance_.take(1, 2 * (sizeof(ElementBlock) + kTreeNode) + groups.size() * sizeof(int));
    mesh_.blocks.push_back({element.shape, element.order, groups.empty() ? 1 : groups.front(), groups, {}, {}, {}, {}});
  }
  ElementBlock& block = mesh_.blocks[at->second];
  allowance_.make_room(block.numbers, 1);
  allowance_.make_room(block.nodes, std::size_t(element.count));
  block.numbers.push_back(element.number);
  for (std::int32_t i = 0; i < element.count; ++i)
    block.nodes.push_back(index_of(nodes_[element.first + std::size_t(i)], element));
}

HighOrderMesh MeshBuilder::take() {
  number_elements();
  check_node_numbers();
  for (const Element& element : elements_) {
    allowance_.look();
    add_to_block(element);
    mesh_.dimension = std::max(mesh_.dimension, reference::info(element.shape).dimension);
  }
  if (mesh_.dimension < 2) fail("it has no elements of a plane or a solid");
  for (const ElementBlock& block : mesh_.blocks)
    if (reference::info(block.shape).dimension == mesh_.dimension) mesh_.order = std::max(mesh_.order, block.order);
  std::set<std::pair<int, int>> used;  // dimension, tag
  for (const ElementBlock& block : mesh_.blocks)
    for (const int tag : block.physical)
      if (used.emplace(reference::info(block.shape).dimension, tag).second) allowance_.take(1, kTreeNode);
  for (PhysicalGroup& group : names_)
    if (used.contains({group.dimension, group.tag})) mesh_.physical_groups.push_back(std::move(group));
  mesh_.node_blocks = {{-1, 0, 0, std::int32_t(mesh_.node_count())}};
  return std::move(mesh_);
}

}  // namespace varimesh::formats
