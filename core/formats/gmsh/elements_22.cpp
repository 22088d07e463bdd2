// Reads the elements of MSH 2.2, ASCII and binary.
#include <algorithm>
#include <cstring>
#include <limits>
#include <optional>
#include <unordered_set>
#include <utility>

#include "core/formats/common/pieces.h"
#include "core/formats/gmsh/blocks.h"
#include "core/formats/gmsh/read.h"
#include "core/mesh/changes/serendipity_elements.h"

namespace varimesh::formats {

namespace {

// The last element. It is held back until the next element shows whether it is a repetition for another physical group.
struct HeldElement {
  bool any = false;
  int type = 0;
  int entity = 0;
  std::vector<int> physical;
  std::vector<int> partitions;
  std::int64_t number = 0;
  std::vector<std::int64_t> repeats;
  std::vector<std::int32_t> nodes;
  std::unordered_set<int> many;  // the physical groups, if there are more than kFew

  bool is_in(int group) const {
    return physical.size() > kFew ? many.contains(group)
                                  : std::find(physical.begin(), physical.end(), group) != physical.end();
  }
  void add(int group, const Scanner& scan) {
    scan.add(physical, group);
    if (physical.size() > kFew) scan.take_memory(kHashed);
    if (physical.size() > kFew + 1) many.insert(group);
    if (physical.size() == kFew + 1) many = {physical.begin(), physical.end()};
  }
  void clear_groups(const Scanner& scan) {
    if (physical.size() > kFew && scan.allowance != nullptr)
      scan.allowance->give_back((physical.size() - kFew) * kHashed);
    physical.clear();
    many.clear();
  }

 private:
  static constexpr std::size_t kHashed = 64;  // what a group in the set takes, at most
  static constexpr std::size_t kFew = 16;     // a search of more would take long if an element has thousands
};

// Reads elements one after another and collects them in blocks.
class ElementReader {
 public:
  /// `expected`: how many elements there are, if that is known.
  ElementReader(const GmshReading& reading, Scanner& scan, std::vector<ElementBlock>& blocks, std::int64_t expected = 0)
      : reading_(reading), scan_(scan), blocks_(blocks), expected_(std::size_t(expected)) {}

  // Reads the tags and nodes of one element, whose number, type and number of tags have been read.
  void read(std::int64_t number, int type, int tag_count);
  // Reads a whole element as text.
  void read_text();
  // Must be called after the last element.
  void finish() { flush(); }
  // Takes back the last element of the last block, so that the next one may be its repetition.
  void hold_last();

 private:
  void set_type(int type);
  void read_tags(int count);
  bool fits_block(const ElementBlock& block) const;
  void flush();

  const GmshReading& reading_;
  Scanner& scan_;
  std::vector<ElementBlock>& blocks_;
  std::size_t expected_;
  std::optional<int> type_;  // of kind_
  GmshType kind_;
  std::size_t node_count_ = 0;
  int physical_ = 0, entity_ = 0;
  std::vector<int> partitions_;
  std::vector<std::int32_t> nodes_;
  HeldElement held_;
};

void ElementReader::set_type(int type) {
  kind_ = accepted_type(scan_, type);
  type_ = type;
  node_count_ = std::size_t(node_count(kind_));
  nodes_.resize(node_count_);
}

// The tags are: physical group, entity, number of partitions, partitions. Old files may have fewer, and in versions 2.0
// and 2.1 the third tag is the partition.
void ElementReader::read_tags(int count) {
  physical_ = count > 0 ? scan_.integer("an element's physical group") : 0;
  entity_ = count > 1 ? scan_.integer("an element's entity") : 0;
  if (count <= 2 && partitions_.empty()) return;
  partitions_.clear();
  if (count <= 2) return;
  const int said = reading_.version < 22 ? 1 : scan_.integer("an element's number of partitions");
  const int first = reading_.version < 22 ? 2 : 3;
  for (int k = first; k < count; ++k) {
    const int partition = scan_.integer("an element's partition");
    if (k - first < said) scan_.add(partitions_, partition);
  }
}

void ElementReader::read(std::int64_t number, int type, int tag_count) {
  scan_.look();
  if (type != type_) set_type(type);
  element_number(scan_, number);
  if (tag_count < 0) scan_.fail("element " + std::to_string(number) + " has a negative number of tags");
  read_tags(tag_count);
  for (std::size_t k = 0; k < node_count_; ++k) {
    const std::int64_t node =
        scan_.binary ? scan_.integer("an element's node") : scan_.text_integer("an element's node");
    nodes_[k] = reading_.node(scan_, node, "element", number);
  }
  const bool repeats = held_.any && held_.type == type && held_.entity == entity_ && nodes_ == held_.nodes &&
                       held_.partitions == partitions_ && physical_ != 0 && !held_.physical.empty() &&
                       !held_.is_in(physical_);
  if (repeats) {
    held_.add(physical_, scan_);
    scan_.add(held_.repeats, number);
    return;
  }
  flush();
  held_.any = true;
  held_.type = type;
  held_.entity = entity_;
  held_.clear_groups(scan_);
  if (physical_ != 0) held_.add(physical_, scan_);
  scan_.reserve(held_.partitions, partitions_.size());
  held_.partitions = partitions_;
  held_.number = number;
  held_.repeats.clear();
  held_.nodes = nodes_;
}

void ElementReader::read_text() {
  const std::int64_t number = scan_.text_integer("an element's number");
  const int type = scan_.integer("an element's type");
  read(number, type, scan_.integer("an element's number of tags"));
}

bool ElementReader::fits_block(const ElementBlock& block) const {
  const GmshType kind = gmsh_type(held_.type);
  return block.shape == kind.shape && block.order == kind.order && nodes_per_element(block) == held_.nodes.size() &&
         block.entity == held_.entity && block.physical == held_.physical && block.partitions == held_.partitions;
}

void ElementReader::flush() {
  if (!held_.any) return;
  if (blocks_.empty() || !fits_block(blocks_.back())) {
    if (!blocks_.empty()) close(blocks_.back(), scan_);
    const GmshType kind = gmsh_type(held_.type);
    add_block(blocks_, {kind.shape, kind.order, held_.entity, held_.physical, {}, {}, held_.partitions, {}}, scan_);
    // Most pieces of a file have one block.
    const std::size_t expected = std::exchange(expected_, 0);
    scan_.reserve(blocks_.back().numbers, expected);
    scan_.reserve(blocks_.back().nodes, expected * held_.nodes.size());
  }
  ElementBlock& block = blocks_.back();
  scan_.add(block.numbers, held_.number);
  add_values(block.repeat_numbers, held_.repeats, scan_);
  add_values(block.nodes, held_.nodes, scan_);
  held_.any = false;
}

void ElementReader::hold_last() {
  if (held_.any || blocks_.empty()) return;
  ElementBlock& block = blocks_.back();
  const auto per_element = std::ptrdiff_t(block.nodes.size() / block.size());
  const auto repeats = std::ptrdiff_t(block.repeat_numbers.size() / block.size());
  held_.any = true;
  held_.type = gmsh_type_number(block);
  held_.entity = block.entity;
  held_.clear_groups(scan_);
  for (const int group : block.physical) held_.add(group, scan_);
  held_.partitions = block.partitions;
  held_.number = block.numbers.back();
  scan_.reserve(held_.repeats, std::size_t(repeats));
  held_.repeats.assign(block.repeat_numbers.end() - repeats, block.repeat_numbers.end());
  held_.nodes.assign(block.nodes.end() - per_element, block.nodes.end());
  block.numbers.pop_back();
  block.repeat_numbers.resize(block.repeat_numbers.size() - std::size_t(repeats));
  block.nodes.resize(block.nodes.size() - std::size_t(per_element));
  if (block.size() == 0) blocks_.pop_back();
}

// === Pieces ==============================================================================================

struct ElementsRead {
  std::vector<ElementBlock> blocks;
  std::int64_t lines = 0;
};

void read_text(GmshReading& reading, std::int64_t n) {
  Scanner& scan = reading.scanner;
  Joiner joiner(reading.mesh.blocks, n, scan);
  const auto parse = [&](const BytesPiece&, Scanner& from) {
    ElementsRead read;
    ElementReader reader(reading, from, read.blocks);
    for (from.skip_space(); !from.at_end(); from.skip_space(), ++read.lines) reader.read_text();
    reader.finish();
    return read;
  };
  RecordCutter cutter(scan, n, 0);
  cutter.keeps_alike_lines_together = true;
  read_in_pieces(scan, reading.team, cutter, parse, [&](const BytesPiece& piece, ElementsRead& read) {
    return joiner.take(read.blocks, read.lines, piece.bytes.size());
  });
  ElementReader rest(reading, scan, reading.mesh.blocks);
  rest.hold_last();
  for (std::int64_t i = joiner.left(); i > 0; --i) rest.read_text();
  rest.finish();
}

// === Binary ==============================================================================================

// A group of elements with one type and number of tags. Gmsh itself writes one element per group.
struct Group {
  int type = 0, tags = 0;
  std::int64_t left = 0;  ///< Elements of the group that have not been read.
};

// Reads the header of a group. At most `most` elements may follow it.
Group read_group(Scanner& scan, std::int64_t most) {
  Group group;
  group.type = scan.integer("an element type");
  group.left = scan.integer("a number of elements");
  group.tags = scan.integer("a number of tags");
  if (group.left <= 0 || group.left > most)
    scan.fail("a group of " + std::to_string(group.left) + " elements is out of range");
  return group;
}

// A piece begins inside a group if `before` has elements left.
struct GroupsPiece {
  std::string_view bytes;
  Group before, after;
  std::int64_t elements = 0;
};

// Cuts after elements, but not between elements that have the same last node, because the second may be a repetition.
class GroupCutter {
 public:
  GroupCutter(const Scanner& scan, std::int64_t count) : ahead_(scan), left_(count) {}

  std::optional<GroupsPiece> operator()() {
    GroupsPiece piece;
    piece.before = piece.after = group_;
    const std::string_view from = ahead_.rest();
    const std::size_t begin = ahead_.offset();
    std::size_t end = 0;
    int alike = 0;
    try {
      while (left_ > 0 && (end < kPieceBytes || (alike++ < kMostAlike && repeats_last()))) {
        if (group_.left == 0) group_ = read_group(ahead_, left_);
        const GmshType kind = gmsh_type(group_.type);
        if (node_count(kind) == 0 || group_.tags < 0) break;
        const std::size_t size = 4 * (1 + std::size_t(group_.tags) + std::size_t(node_count(kind)));
        if (ahead_.left() < size) break;
        ahead_.go_to(ahead_.offset() + size);
        end = ahead_.offset() - begin;
        --group_.left;
        --left_;
        ++piece.elements;
        piece.after = group_;
      }
    } catch (const ReadFailure&) {
      left_ = 0;  // the plain reader says what is wrong
    }
    if (end == 0) return std::nullopt;
    piece.bytes = from.substr(0, end);
    ahead_.go_to(begin + end);
    group_ = piece.after;
    return piece;
  }

 private:
  // Whether the next element ends with the same node as the last. Looks only at groups of one element.
  bool repeats_last() const {
    constexpr std::size_t kHeader = 12;
    const GmshType kind = gmsh_type(group_.type);
    if (group_.left > 0) return false;
    const std::size_t size = kHeader + 4 * (1 + std::size_t(group_.tags) + std::size_t(node_count(kind)));
    if (ahead_.left() < size) return false;
    return std::memcmp(ahead_.rest().data() - 4, ahead_.rest().data() + size - 4, 4) == 0;
  }

  Scanner ahead_;
  std::int64_t left_;
  Group group_;
};

void read_group_element(ElementReader& reader, Scanner& scan, Group& group) {
  const int number = scan.integer("an element's number");
  reader.read(number, group.type, group.tags);
  --group.left;
}

void read_binary(GmshReading& reading, std::int64_t n) {
  Scanner& scan = reading.scanner;
  Joiner joiner(reading.mesh.blocks, n, scan);
  Group group;
  const auto parse = [&](const GroupsPiece& piece, Scanner& from) {
    ElementsRead read;
    ElementReader reader(reading, from, read.blocks, piece.elements);
    Group inside = piece.before;
    for (; !from.at_end(); ++read.lines) {
      if (inside.left == 0) inside = read_group(from, std::numeric_limits<std::int32_t>::max());
      read_group_element(reader, from, inside);
    }
    reader.finish();
    return read;
  };
  const auto take = [&](const GroupsPiece& piece, ElementsRead& read) {
    if (!joiner.take(read.blocks, read.lines, piece.bytes.size())) return false;
    group = piece.after;
    return true;
  };
  read_in_pieces(scan, reading.team, GroupCutter(scan, n), parse, take);
  ElementReader rest(reading, scan, reading.mesh.blocks);
  rest.hold_last();
  for (std::int64_t i = joiner.left(); i > 0; --i) {
    if (group.left == 0) group = read_group(scan, i);
    read_group_element(rest, scan, group);
  }
  rest.finish();
}

}  // namespace

void read_elements_22(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const std::int64_t n = scan.count("the number of elements", 8, true);
  if (!scan.binary) return read_text(reading, n);
  scan.line();
  read_binary(reading, n);
}

}  // namespace varimesh::formats
