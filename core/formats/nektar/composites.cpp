#include "core/formats/nektar/composites.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <limits>
#include <map>
#include <set>
#include <unordered_map>

#include "core/base/io/scanner.h"

namespace varimesh::formats {

namespace {

/// A list such as "F[0-3,7] F[9]": letters, and ranges of numbers.
class ListReader {
 public:
  ListReader(const NektarFile& file, XmlText text) : scan_(file.bytes.substr(0, text.begin + text.length)) {
    scan_.go_to(text.begin);
  }

  /// Calls body(letter, number) for each entry.
  template <class Body>
  void read(const Body& body) {
    for (scan_.skip_space(); !scan_.at_end(); scan_.skip_space()) {
      const char letter = next();
      if (next() != '[') scan_.fail("a list such as F[0-3,7] was expected");
      char end = ',';
      while (end == ',') {
        const std::int64_t first = number();
        std::int64_t last = first;
        end = next();
        if (end == '-') last = number(), end = next();
        if (last < first) scan_.fail("a range of numbers runs backwards");
        for (std::int64_t k = first; k <= last; ++k) body(letter, k);
      }
      if (end != ']') scan_.fail("a list such as F[0-3,7] was expected");
    }
  }

  [[noreturn]] void fail(const std::string& what) const { scan_.fail(what); }

 private:
  char next() {
    scan_.skip_space();
    if (scan_.at_end()) scan_.fail("a list such as F[0-3,7] was expected");
    const char c = scan_.peek();
    scan_.go_to(scan_.offset() + 1);
    return c;
  }
  std::int64_t number() {
    scan_.skip_space();
    const std::string_view rest = scan_.rest();
    std::int64_t value = 0;
    const auto [stop, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
    if (error != std::errc() || value < 0) scan_.fail("a number from 0 on was expected");
    scan_.go_to(scan_.offset() + std::size_t(stop - rest.data()));
    return value;
  }

  Scanner scan_;
};

int dimension_of(char letter) {
  switch (letter) {
    case 'V':
      return 0;
    case 'E':
    case 'S':
      return 1;
    case 'F':
    case 'T':
    case 'Q':
      return 2;
    case 'A':
    case 'P':
    case 'R':
    case 'H':
      return 3;
    default:
      return -1;
  }
}

void check_ids(const NektarFile& file) {
  std::set<std::int64_t> ids;
  for (const NektarComposite& composite : file.composites) {
    if (composite.id >= std::numeric_limits<int>::max())
      Scanner(file.bytes).fail("the composite number " + std::to_string(composite.id) + " is too large");
    if (!ids.insert(composite.id).second)
      Scanner(file.bytes).fail("the composite " + std::to_string(composite.id) + " occurs twice");
  }
}

}  // namespace

NektarGroups nektar_groups(NektarFile& file, FileAllowance& allowance) {
  check_ids(file);
  NektarGroups groups;
  allowance.take(file.elements.ids.size(), sizeof(std::int32_t));
  groups.of_elements.resize(file.elements.ids.size());
  std::int64_t most = 0;
  for (const NektarComposite& composite : file.composites) most = std::max(most, composite.id);
  std::unordered_map<std::int32_t, std::size_t> place;          // of a side in of_sides
  std::map<std::pair<std::int32_t, int>, std::int32_t> longer;  // the list that a list becomes with one more tag
  const auto add = [&](std::int32_t& list, int tag) {
    const auto [found, fresh] = longer.try_emplace({list, tag}, std::int32_t(groups.lists.size()));
    if (fresh) {
      std::vector<int> tags = groups.lists[std::size_t(list)];
      tags.push_back(tag);
      allowance.take(1, 150 + tags.size() * sizeof(int));
      groups.lists.push_back(std::move(tags));
    }
    list = found->second;
  };
  for (const NektarComposite& composite : file.composites) {
    if (composite.name == kNektarWholeDomain) continue;
    const int tag = int(composite.id == 0 ? most + 1 : composite.id);
    const bool is_group = composite.name != kNektarUngrouped;
    if (composite.id == 0 && is_group) file.others.push_back({std::string(kNektarZero), std::to_string(tag), "nektar"});
    ListReader list(file, composite.text);
    int dimension = -1;
    list.read([&](char letter, std::int64_t id) {
      const int own = dimension_of(letter);
      if (own < 0) list.fail("'" + std::string(1, letter) + "' is no letter of a composite");
      if (dimension >= 0 && own != dimension) list.fail("the composite mixes dimensions");
      dimension = own;
      allowance.take(1, 8);
      if (own == file.dimension) {
        const std::int32_t element = file.elements.ids.find(id);
        if (element < 0 || (letter != 'F' && letter != nektar_letter(file.elements.shapes[std::size_t(element)])))
          list.fail("composite " + std::to_string(composite.id) + " refers to element " + letter + "[" +
                    std::to_string(id) + "], which is not in the file");
        if (is_group) add(groups.of_elements[std::size_t(element)], tag);
      } else if (own == file.dimension - 1) {
        const std::int32_t side = (own == 1 ? file.edge_ids : file.faces.ids).find(id);
        if (side < 0)
          list.fail("composite " + std::to_string(composite.id) + " refers to " + letter + "[" + std::to_string(id) +
                    "], which is not in the file");
        const auto [found, fresh] = place.try_emplace(side, groups.of_sides.size());
        if (fresh) {
          allowance.take(1, 100);
          groups.of_sides.emplace_back(side, std::vector<int>());
        }
        if (is_group) groups.of_sides[found->second].second.push_back(tag);
      }
    });
    if (is_group && !composite.name.empty() && dimension >= file.dimension - 1)
      groups.named.push_back({dimension, tag, composite.name});
  }
  return groups;
}

// === Writing =============================================================================================

namespace {

/// The tag that composite 0 got when the mesh was read; 0 if it had none.
int tag_of_zero(const HighOrderMesh& mesh) {
  for (const ForeignSection& section : mesh.foreign)
    if (section.format == "nektar" && section.name == kNektarZero) return std::atoi(section.bytes.c_str());
  return 0;
}

}  // namespace

NektarComposites nektar_composites(const HighOrderMesh& mesh) {
  constexpr int kUngrouped = 0;
  const int zero = tag_of_zero(mesh);
  NektarComposites made;
  std::set<int> ids;
  // A tag may belong to a group of each dimension, but the number of a composite only to one.
  std::map<std::pair<int, int>, std::size_t> place;  // by dimension and tag
  int next = 0;
  for (const ElementBlock& block : mesh.blocks)
    for (const int tag : block.physical) next = std::max(next, std::abs(tag));
  std::map<std::pair<int, int>, const std::string*> names;  // by dimension and tag
  for (const PhysicalGroup& group : mesh.physical_groups) {
    next = std::max(next, group.tag);
    names[{group.dimension, group.tag}] = &group.name;
  }
  const auto composite = [&](int dimension, int tag) -> NektarComposites::One& {
    const auto [found, fresh] = place.try_emplace({dimension, tag}, made.all.size());
    if (fresh) {
      int id = tag == zero ? 0 : tag;
      if (!ids.insert(id).second) ids.insert(id = ++next);
      made.all.push_back({id, {}, dimension, {}});
      if (tag == kUngrouped) made.all.back().name = kNektarUngrouped;
      if (const auto named = names.find({dimension, tag}); named != names.end()) made.all.back().name = *named->second;
    }
    return made.all[found->second];
  };
  bool overlapping = false;
  for (const int d : {mesh.dimension, mesh.dimension - 1})
    for (std::size_t b = 0; b < mesh.blocks.size(); ++b) {
      const ElementBlock& block = mesh.blocks[b];
      if (reference::info(block.shape).dimension != d || block.size() == 0) continue;
      std::vector<int> tags;
      std::set<int> known;
      for (const int tag : block.physical)
        if (known.insert(std::abs(tag)).second) tags.push_back(std::abs(tag));
      if (tags.empty()) tags.push_back(kUngrouped);
      for (const int tag : tags) composite(d, tag).blocks.push_back(b);
      overlapping = overlapping || (d == mesh.dimension && tags.size() > 1);
    }
  if (overlapping) {
    NektarComposites::One whole{++next, std::string(kNektarWholeDomain), mesh.dimension, {}};
    for (std::size_t b = 0; b < mesh.blocks.size(); ++b)
      if (reference::info(mesh.blocks[b].shape).dimension == mesh.dimension) whole.blocks.push_back(b);
    made.domain = std::to_string(whole.id);
    made.all.push_back(std::move(whole));
    return made;
  }
  for (const NektarComposites::One& one : made.all)
    if (one.dimension == mesh.dimension) made.domain += (made.domain.empty() ? "" : ",") + std::to_string(one.id);
  return made;
}

}  // namespace varimesh::formats
