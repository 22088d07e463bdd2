// Reads the sections of MSH 2.2, ASCII and binary.
#include <algorithm>

#include "core/formats/gmsh/read.h"

namespace varimesh::formats {

void read_nodes_22(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  HighOrderMesh& mesh = reading.mesh;
  const bool parametric = scan.section == "ParametricNodes";
  const std::int64_t n = scan.count("the number of nodes", 8, true);
  if (scan.binary) scan.line();
  mesh.node_numbers.resize(std::size_t(n));
  mesh.coordinates.resize(std::size_t(3 * n));
  for (std::size_t i = 0; i < std::size_t(n); ++i) {
    mesh.node_numbers[i] = scan.binary ? scan.integer("a node's number") : scan.text_integer("a node's number");
    for (std::size_t k = 0; k < 3; ++k) mesh.coordinates[3 * i + k] = scan.number("a node's coordinate");
    if (!parametric) continue;
    // Parameters on the entity are skipped, because they are wrong after the nodes have moved.
    const int dimension = scan.integer("a node's entity dimension");
    scan.integer("a node's entity");
    const int parameters = dimension == 1 || dimension == 2 ? dimension : 0;
    for (int k = 0; k < parameters; ++k) scan.number("a node's parameter");
  }
  mesh.node_blocks.push_back({-1, 0, 0, std::int32_t(n)});
  reading.index.build(mesh.node_numbers, scan);
}

// === Elements ============================================================================================

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
};

class ElementReader {
 public:
  ElementReader(GmshReading& reading, std::int64_t total) : reading_(reading), total_(total) {}

  // Reads the tags and nodes of one element, whose number, type and number of tags have been read.
  void read(std::int64_t number, int type, int tag_count);
  // Must be called after the last element.
  void finish();

 private:
  void set_type(int type);
  void read_tags(int count);
  bool fits_block(const ElementBlock& block) const;
  void flush();
  void grow(ElementBlock& block);

  GmshReading& reading_;
  std::int64_t total_;
  std::int64_t done_ = 0;
  int type_ = 0;
  GmshType kind_;
  std::size_t node_count_ = 0;
  int physical_ = 0, entity_ = 0;
  std::vector<int> partitions_;
  std::vector<std::int32_t> nodes_;
  HeldElement held_;
};

void ElementReader::set_type(int type) {
  kind_ = accepted_type(reading_.scanner, type);
  type_ = type;
  node_count_ = std::size_t(reference::node_count(kind_.shape, kind_.order));
  nodes_.resize(node_count_);
}

// The tags are: physical group, entity, number of partitions, partitions. Old files may have fewer.
void ElementReader::read_tags(int count) {
  Scanner& scan = reading_.scanner;
  physical_ = count > 0 ? scan.integer("an element's physical group") : 0;
  entity_ = count > 1 ? scan.integer("an element's entity") : 0;
  if (count <= 2 && partitions_.empty()) return;
  partitions_.clear();
  if (count <= 2) return;
  const int said = scan.integer("an element's number of partitions");
  for (int k = 3; k < count; ++k) {
    const int partition = scan.integer("an element's partition");
    if (k - 3 < said) partitions_.push_back(partition);
  }
}

void ElementReader::read(std::int64_t number, int type, int tag_count) {
  Scanner& scan = reading_.scanner;
  if (type != type_) set_type(type);
  if (tag_count < 0) scan.fail("element " + std::to_string(number) + " has a negative number of tags");
  read_tags(tag_count);
  for (std::size_t k = 0; k < node_count_; ++k) {
    const std::int64_t node = scan.binary ? scan.integer("an element's node") : scan.text_integer("an element's node");
    nodes_[k] = reading_.node(node, "element", number);
  }
  ++done_;
  const bool repeats = held_.any && held_.type == type && held_.entity == entity_ && nodes_ == held_.nodes &&
                       held_.partitions == partitions_ && physical_ != 0 && !held_.physical.empty() &&
                       std::find(held_.physical.begin(), held_.physical.end(), physical_) == held_.physical.end();
  if (repeats) {
    held_.physical.push_back(physical_);
    held_.repeats.push_back(number);
    return;
  }
  flush();
  held_.any = true;
  held_.type = type;
  held_.entity = entity_;
  held_.physical.clear();
  if (physical_ != 0) held_.physical.push_back(physical_);
  held_.partitions = partitions_;
  held_.number = number;
  held_.repeats.clear();
  held_.nodes = nodes_;
}

bool ElementReader::fits_block(const ElementBlock& block) const {
  const GmshType kind = gmsh_type(held_.type);
  return block.shape == kind.shape && block.order == kind.order && block.entity == held_.entity &&
         block.physical == held_.physical && block.partitions == held_.partitions;
}

// Doubling the capacity would temporarily need up to three times the block's size. When a block turns out to be large,
// it therefore reserves memory for all elements that may follow. Pages that are never used cost nothing, and the rest
// is freed at the end of the block.
void ElementReader::grow(ElementBlock& block) {
  constexpr std::size_t kLarge = 4096;
  if (block.numbers.size() != kLarge) return;
  const std::size_t per_element = block.nodes.size() / kLarge;
  const std::size_t least_bytes = reading_.scanner.binary ? 4 * per_element + 4 : 2 * per_element + 4;
  const std::size_t more = std::min(std::size_t(total_ - done_), reading_.scanner.left() / least_bytes) + 2;
  block.numbers.reserve(kLarge + more);
  block.nodes.reserve((kLarge + more) * per_element);
}

void ElementReader::flush() {
  if (!held_.any) return;
  std::vector<ElementBlock>& blocks = reading_.mesh.blocks;
  if (blocks.empty() || !fits_block(blocks.back())) {
    if (!blocks.empty() && blocks.back().size() < blocks.back().numbers.capacity()) {
      blocks.back().numbers.shrink_to_fit();
      blocks.back().nodes.shrink_to_fit();
    }
    const GmshType kind = gmsh_type(held_.type);
    blocks.push_back({kind.shape, kind.order, held_.entity, held_.physical, {}, {}, held_.partitions, {}});
  }
  ElementBlock& block = blocks.back();
  grow(block);
  block.numbers.push_back(held_.number);
  block.repeat_numbers.insert(block.repeat_numbers.end(), held_.repeats.begin(), held_.repeats.end());
  block.nodes.insert(block.nodes.end(), held_.nodes.begin(), held_.nodes.end());
  held_.any = false;
}

void ElementReader::finish() { flush(); }

}  // namespace

void read_elements_22(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const std::int64_t n = scan.count("the number of elements", 8, true);
  ElementReader reader(reading, n);
  if (!scan.binary) {
    for (std::int64_t i = 0; i < n; ++i) {
      const std::int64_t number = scan.text_integer("an element's number");
      const int type = scan.integer("an element's type");
      reader.read(number, type, scan.integer("an element's number of tags"));
    }
  } else {
    // Groups of elements with one type and number of tags. Gmsh itself writes one element per group.
    scan.line();
    for (std::int64_t i = 0; i < n;) {
      const int type = scan.integer("an element type");
      const int count = scan.integer("a number of elements");
      const int tags = scan.integer("a number of tags");
      if (count <= 0 || count > n - i) scan.fail("a group of " + std::to_string(count) + " elements is out of range");
      for (int k = 0; k < count; ++k, ++i) {
        const int number = scan.integer("an element's number");
        reader.read(number, type, tags);
      }
    }
  }
  reader.finish();
}

// The section is text, also in binary files.
void read_periodic_22(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const std::int64_t links = scan.count("the number of periodic links", 6, true);
  for (std::int64_t i = 0; i < links; ++i) {
    PeriodicLink link;
    link.dimension = int(scan.text_integer("a periodic entity's dimension"));
    link.entity = int(scan.text_integer("a periodic entity"));
    link.master = int(scan.text_integer("a periodic entity's master"));
    scan.skip_space();
    if (scan.peek() == 'A') {
      Scanner affine(scan.line().substr(6));
      affine.section = scan.section;
      for (affine.skip_space(); !affine.at_end(); affine.skip_space())
        link.affine.push_back(affine.text_number("a periodic link's affine map"));
    }
    const std::int64_t n = scan.count("the number of periodic nodes", 3, true);
    link.nodes.reserve(std::size_t(n));
    for (std::int64_t k = 0; k < n; ++k) {
      const std::int64_t slave = scan.text_integer("a periodic node");
      const std::int64_t master = scan.text_integer("a periodic node's master");
      link.nodes.emplace_back(reading.node(slave, "periodic entity", link.entity),
                              reading.node(master, "periodic entity", link.entity));
    }
    reading.mesh.periodic.push_back(std::move(link));
  }
}

}  // namespace varimesh::formats
