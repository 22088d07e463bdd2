#include "core/formats/mfem/attributes.h"

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <set>

namespace varimesh::formats {

namespace {

/// A tag without its sign; the largest int for the one int that has no opposite.
int magnitude(int tag) {
  return tag == std::numeric_limits<int>::min() ? std::numeric_limits<int>::max() : std::abs(tag);
}

bool is_attribute(int number) { return number >= 1 && number <= kMostAttribute; }

/// What an element is in: its physical groups, or minus its entity if it is in none. MSH 4.1 marks groups that reverse
/// an entity with a minus sign.
std::vector<int> membership(const ElementBlock& block) {
  std::vector<int> in;
  for (const int tag : block.physical) in.push_back(magnitude(tag));
  if (in.empty()) in.push_back(-magnitude(block.entity));
  return in;
}

}  // namespace

MfemAttributes mfem_attributes(const HighOrderMesh& mesh, int dimension) {
  // Attributes by membership, in the order of the file. Elements of a single group keep its tag, whatever comes first.
  std::map<std::vector<int>, int> attribute;
  std::vector<std::vector<int>> order;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == dimension)
      if (attribute.try_emplace(membership(block), 0).second) order.push_back(membership(block));
  std::set<int> used;
  const auto give = [&](std::vector<int>& in, int wanted) {
    if (attribute[in] == 0 && is_attribute(wanted) && used.insert(wanted).second) attribute[in] = wanted;
  };
  for (auto& in : order)
    if (in.size() == 1 && in[0] > 0) give(in, in[0]);
  for (auto& in : order) give(in, in[0]);
  for (const PhysicalGroup& group : mesh.physical_groups)
    if (group.dimension == dimension) used.insert(group.tag);
  for (auto& in : order) give(in, -in[0]);
  int next = 1;
  for (auto& in : order) {
    while (used.contains(next)) ++next;
    give(in, next);
  }

  MfemAttributes made;
  for (const ElementBlock& block : mesh.blocks)
    made.of_block.push_back(reference::info(block.shape).dimension == dimension ? attribute[membership(block)] : 0);

  std::map<int, std::vector<int>> members;  // by tag
  for (const auto& in : order)
    for (const int own = attribute[in]; const int tag : in) members[tag].push_back(own);
  std::vector<std::pair<int, std::string>> groups;
  std::set<int> named;
  for (const PhysicalGroup& group : mesh.physical_groups)
    if (group.dimension == dimension && !group.name.empty()) {
      groups.emplace_back(group.tag, group.name);
      named.insert(group.tag);
    }
  for (const auto& in : order)
    for (const int own = attribute[in]; const int tag : in)
      if (tag > 0 && tag != own && named.insert(tag).second) groups.emplace_back(tag, "group " + std::to_string(tag));
  for (const auto& [tag, name] : groups) {
    // A group without elements keeps its name by its tag.
    std::vector<int> own = members.contains(tag) ? members[tag]
                           : is_attribute(tag)   ? std::vector{tag}
                                                 : std::vector<int>();
    std::ranges::sort(own);
    std::string plain = name;
    std::ranges::replace(plain, '"', '\'');
    made.sets.emplace_back(plain, own);
  }
  return made;
}

void write_mfem_sets(std::string_view section, const MfemAttributes& attributes, BufferedOutput& out) {
  out.text("\n");
  out.text(section);
  out.text("\n");
  out.text_integer(std::int64_t(attributes.sets.size()));
  out.text("\n");
  for (const auto& [name, members] : attributes.sets) {
    out.text("\"");
    out.text(name);
    out.text("\" ");
    out.text_integer(std::int64_t(members.size()));
    for (const int attribute : members) {
      out.text(" ");
      out.text_integer(attribute);
    }
    out.text("\n");
  }
}

}  // namespace varimesh::formats
