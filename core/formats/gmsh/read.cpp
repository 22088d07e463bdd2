// Reads Gmsh's MSH files: the sequence of sections, and the sections that are the same in both versions.
// Format: Gmsh reference manual, "MSH file format" (4.1) and "MSH file format version 2" (2.2). The manuals of Gmsh 4.0
// and of Gmsh 2.0 to 2.4 describe the older versions.
#include "core/formats/gmsh/read.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>

#include "core/formats/common/format.h"

namespace varimesh::formats {

// === Node numbers =========================================================================================

void NodeIndex::build(const std::vector<std::int64_t>& numbers, const Scanner& scanner) {
  const auto twice = [&](std::int64_t number) {
    scanner.fail("node number " + std::to_string(number) + " appears twice; renumber the mesh");
  };
  identity_ = true;
  largest_ = 0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] <= 0) scanner.fail("node number " + std::to_string(numbers[i]) + " is not positive");
    if (numbers[i] != std::int64_t(i) + 1) identity_ = false;
    largest_ = std::max(largest_, numbers[i]);
  }
  if (identity_) return;
  scanner.look();
  if (largest_ <= std::int64_t(2 * numbers.size() + 1024)) {
    scanner.reserve(dense_, std::size_t(largest_) + 1);
    dense_.assign(std::size_t(largest_) + 1, -1);
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      std::int32_t& slot = dense_[std::size_t(numbers[i])];
      if (slot >= 0) twice(numbers[i]);
      slot = std::int32_t(i);
    }
    return;
  }
  scanner.reserve(sorted_, numbers.size());
  sorted_.resize(numbers.size());
  for (std::size_t i = 0; i < numbers.size(); ++i) sorted_[i] = {numbers[i], std::int32_t(i)};
  std::sort(sorted_.begin(), sorted_.end());
  for (std::size_t i = 1; i < sorted_.size(); ++i)
    if (sorted_[i].first == sorted_[i - 1].first) twice(sorted_[i].first);
}

std::int32_t NodeIndex::find_sorted(std::int64_t number) const {
  const auto at = std::lower_bound(sorted_.begin(), sorted_.end(), std::pair(number, std::int32_t(0)));
  return at != sorted_.end() && at->first == number ? at->second : -1;
}

GmshType accepted_type(const Scanner& scanner, int number) {
  const GmshType type = gmsh_type(number);
  if (node_count(type) == 0) scanner.fail(why_refused(number));
  return type;
}

GmshType type_of_block(Scanner& scan, int dimension, ElementBlock& block) {
  const GmshType type = accepted_type(scan, scan.integer("an element block's type"));
  block.shape = type.shape;
  block.order = type.order;
  if (dimension != reference::info(type.shape).dimension)
    scan.fail("an element block of dimension " + std::to_string(dimension) + " contains " +
              std::string(reference::info(type.shape).plural));
  return type;
}

// === Sections ============================================================================================

namespace {

constexpr const char* kHowTo = "Gmsh writes versions 2.2 and 4.1, for example with -format msh41";
constexpr const char* kSecondSection = "the file has a second section with this name";

// $MeshFormat: the version, whether the file is binary, and the size of a double or size_t.
void read_mesh_format(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const double version = scan.text_number("the version of the format");
  const std::int64_t binary = scan.text_integer("the file type (0 or 1)");
  const std::int64_t size = scan.text_integer("the data size");
  constexpr std::array kVersions{20, 21, 22, 40, 41};
  reading.version = std::abs(version) < 100 ? int(std::lround(10 * version)) : 0;
  if (10 * version != reading.version || std::ranges::find(kVersions, reading.version) == kVersions.end()) {
    std::string text = std::to_string(version);
    text.resize(text.find('.') + 2);
    scan.fail("MSH version " + text + " is not supported; write 2.2 or 4.1: " + kHowTo);
  }
  if (binary != 0 && binary != 1) scan.fail("the file type must be 0 (ASCII) or 1 (binary)");
  if (size != 8) scan.fail("the data size is " + std::to_string(size) + ", but must be 8");
  if (binary == 1) {
    scan.line();
    scan.binary = true;
    const int one = scan.integer("the number 1, which shows the byte order,");
    if (one == 0x01000000)
      scan.fail(std::string("the file was written on a machine with another byte order; write it as ASCII; ") + kHowTo);
    if (one != 1) scan.fail("the number that shows the byte order is not 1");
  }
  if (reading.version <= 22)
    reading.format = binary ? Format::Msh22Binary : Format::Msh22;
  else
    reading.format = binary ? Format::Msh41Binary : Format::Msh41;
}

// The section is text, also in binary files. A name may contain quotation marks; it ends at the last one of the line.
void read_physical_names(GmshReading& reading) {
  Scanner& scan = reading.scanner;
  const std::int64_t n = scan.count("the number of physical names", 4, true);
  for (std::int64_t i = 0; i < n; ++i) {
    scan.look();
    PhysicalGroup group;
    const int first_number = int(scan.text_integer("a physical group's dimension"));
    scan.skip_space();
    const bool has_dimension = reading.version > 20 || scan.peek() != '"';
    group.dimension = has_dimension ? first_number : -1;
    group.tag = has_dimension ? int(scan.text_integer("a physical group's tag")) : first_number;
    const std::string_view rest = scan.line();
    const std::size_t first = rest.find('"'), last = rest.rfind('"');
    if (first == std::string_view::npos || first == last)
      scan.fail("a physical group's name in quotation marks was expected");
    scan.take_memory(kAllocation + last - first);
    group.name = rest.substr(first + 1, last - first - 1);
    scan.add(reading.mesh.physical_groups, std::move(group));
  }
}

// The groups of version 2.0 have no dimension. They get those of the elements that are in them.
void give_dimensions(GmshReading& reading) {
  HighOrderMesh& mesh = reading.mesh;
  const auto has_none = [](const PhysicalGroup& group) { return group.dimension < 0; };
  if (std::ranges::none_of(mesh.physical_groups, has_none)) return;
  std::map<int, std::array<bool, 4>> found;  // by tag: the dimensions of its elements
  for (const PhysicalGroup& group : mesh.physical_groups) {
    reading.scanner.take_memory(kTreeNode);
    found[group.tag] = {};
  }
  for (const ElementBlock& block : mesh.blocks)
    for (const int tag : block.physical) {
      reading.scanner.look();
      if (const auto at = found.find(tag); at != found.end())
        at->second[std::size_t(reference::info(block.shape).dimension)] = true;
    }
  std::vector<PhysicalGroup> groups;
  const auto add = [&](int dimension, const PhysicalGroup& group) {
    reading.scanner.take_memory(kAllocation + group.name.size());
    reading.scanner.add(groups, PhysicalGroup{dimension, group.tag, group.name});
  };
  for (const PhysicalGroup& group : mesh.physical_groups) {
    if (!has_none(group)) add(group.dimension, group);
    for (int dimension = 0; dimension < 4 && has_none(group); ++dimension)
      if (found[group.tag][std::size_t(dimension)]) add(dimension, group);
  }
  mesh.physical_groups = std::move(groups);
}

// Keeps a section that VariMesh does not use.
void read_foreign(GmshReading& reading, const std::string& name) {
  bool found = false;
  const std::string_view bytes = reading.scanner.until_line("$End" + name, found);
  if (!found) reading.scanner.fail_truncated(("$End" + name).c_str());
  reading.scanner.take_memory(bytes.size() + name.size() + 3 * kAllocation);
  reading.scanner.add(reading.mesh.foreign, ForeignSection{name, std::string(bytes), {}});
}

void expect_end(Scanner& scan, const std::string& name) {
  scan.skip_space();
  if (scan.at_end()) scan.fail_truncated(("$End" + name).c_str());
  const std::size_t at = scan.offset();
  if (scan.peek() != '$' || scan.line() != "$End" + name)
    scan.fail("$End" + name + " was expected at byte " + std::to_string(at) +
              ": the section does not contain as many entries as it announces");
}

void read_section(GmshReading& reading, const std::string& name) {
  const bool v22 = reading.format == Format::Msh22 || reading.format == Format::Msh22Binary;
  const auto once = [&](bool& flag) {
    if (flag) reading.scanner.fail(kSecondSection);
    flag = true;
  };
  const auto after_nodes = [&] {
    if (!reading.has_nodes) reading.scanner.fail("the section comes before $Nodes");
  };
  if (name == "PhysicalNames") {
    read_physical_names(reading);
  } else if (name == "Nodes" || (name == "ParametricNodes" && v22)) {
    once(reading.has_nodes);
    v22 ? read_nodes_22(reading) : reading.version == 40 ? read_nodes_40(reading) : read_nodes_41(reading);
  } else if (name == "Elements") {
    after_nodes();
    once(reading.has_elements);
    v22 ? read_elements_22(reading) : reading.version == 40 ? read_elements_40(reading) : read_elements_41(reading);
  } else if (name == "Periodic") {
    after_nodes();
    if (reading.version == 40 && reading.scanner.binary)
      reading.scanner.fail(std::string("periodic links are not read from binary files of version 4.0; ") + kHowTo);
    reading.version <= 40 ? read_periodic_22(reading) : read_periodic_41(reading);
  } else if (name == "Entities" && !v22) {
    if (reading.has_nodes) reading.scanner.fail("the section comes after $Nodes");
    read_entities_41(reading);
  } else {
    if (name == "PartitionedEntities" && reading.version == 40)
      reading.scanner.fail(std::string("partitions are not read from files of version 4.0; ") + kHowTo);
    if (name == "PartitionedEntities" && !v22) {
      // The section is kept unchanged, but also read, because it says in which groups the parts are.
      GmshReading copy{
          reading.team, reading.allowance, reading.scanner, {}, reading.format, reading.version, {}, {}, false, false};
      read_partitioned_entities_41(copy);
      reading.entity_groups.merge(copy.entity_groups);
    }
    read_foreign(reading, name);
  }
  expect_end(reading.scanner, name);
}

void set_dimension_and_order(HighOrderMesh& mesh) {
  for (const ElementBlock& block : mesh.blocks) {
    const int d = reference::info(block.shape).dimension;
    if (mesh.order == 0 || d > mesh.dimension) mesh.order = block.order;
    mesh.dimension = std::max(mesh.dimension, d);
  }
}

}  // namespace

bool begins_like_gmsh(std::string_view bytes) {
  const std::size_t at = bytes.find_first_not_of(" \t\r\n");
  return at != std::string_view::npos && bytes[at] == '$' && at + 1 < bytes.size() &&
         std::isalpha(static_cast<unsigned char>(bytes[at + 1])) != 0;  // comments of Nastran begin with $ too
}

Expected<MeshFile> read_gmsh(std::string_view bytes, const Team& team) {
  Allowance allowance(most_mesh_memory(std::int64_t(bytes.size())), team.stop(), WithheldMemory::current());
  GmshReading reading{team, allowance, Scanner(bytes), {}, Format::Auto, 0, {}, {}, false, false};
  Scanner& scan = reading.scanner;
  scan.allowance = &allowance;
  for (scan.skip_space(); !scan.at_end(); scan.skip_space()) {
    scan.section.clear();
    scan.look();
    if (scan.peek() != '$') scan.fail("the first line of a section ($...) was expected");
    const std::string name(scan.line().substr(1));
    scan.section = name.substr(0, 40);
    if (name == "MeshFormat") {
      if (reading.format != Format::Auto) scan.fail(kSecondSection);
      read_mesh_format(reading);
      expect_end(scan, name);
    } else if (reading.format == Format::Auto && name == "NOD") {
      scan.fail(std::string("MSH version 1 is not supported; write 2.2 or 4.1: ") + kHowTo);
    } else if (reading.format == Format::Auto && name != "Comments") {
      scan.fail("$MeshFormat must come first");
    } else {
      read_section(reading, name);
    }
  }
  scan.section.clear();
  if (reading.format == Format::Auto) scan.fail_truncated("$MeshFormat");
  if (!reading.has_nodes) scan.fail_truncated("$Nodes");
  if (!reading.has_elements) scan.fail_truncated("$Elements");
  for (ForeignSection& foreign : reading.mesh.foreign) foreign.format = format_name(reading.format);
  set_dimension_and_order(reading.mesh);
  give_dimensions(reading);
  return MeshFile{std::move(reading.mesh), reading.format};
}

}  // namespace varimesh::formats
