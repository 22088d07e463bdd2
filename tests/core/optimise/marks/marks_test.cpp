// What a written mesh tells a viewer: fields of numbers, and a group of the cells that cannot be repaired.
#include "core/optimise/marks/marks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core/quality/quality.h"
#include "tests/core/support/cases.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

UnrepairableGroup group_of(std::vector<std::int32_t> cells) {
  UnrepairableGroup group;
  group.cells = std::move(cells);
  return group;
}

/// A mesh with several blocks of cells, all in the group "air".
HighOrderMesh two_blocks() {
  HighOrderMesh mesh = testing::grid(Filling::MixedPlane, {4, 2, 0}, 2);
  mesh.physical_groups.push_back({2, 40, "air"});
  for (ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == 2) block.physical = {40};
  mesh.entities.push_back({2, 1, {0, 0, 0, 1, 1, 0}, {40}, {}});
  return mesh;
}

/// Numbers of the cells in the physical group of that name.
std::set<std::int64_t> in_group(const HighOrderMesh& mesh, const std::string& name) {
  std::set<std::int64_t> numbers;
  for (const PhysicalGroup& group : mesh.physical_groups)
    for (const ElementBlock& block : mesh.blocks)
      if (group.name == name && reference::info(block.shape).dimension == group.dimension &&
          std::ranges::count(block.physical, group.tag) > 0)
        numbers.insert(block.numbers.begin(), block.numbers.end());
  return numbers;
}

/// Numbers of the mesh's cells, in its order.
std::vector<std::int64_t> numbers_of(const HighOrderMesh& mesh) {
  std::vector<std::int64_t> numbers;
  for (const ElementBlock& block : mesh.blocks)
    if (reference::info(block.shape).dimension == mesh.dimension)
      numbers.insert(numbers.end(), block.numbers.begin(), block.numbers.end());
  return numbers;
}

// === Fields ==============================================================================================

TEST(CellMarks, HasANumberForEveryCellInEveryField) {
  const HighOrderMesh mesh = testing::read_case("nine_triangles.msh");
  const CellMarks marks(mesh, {}, 1);
  const std::vector<formats::CellField> fields = marks.fields();
  std::vector<std::string> names;
  for (const formats::CellField& field : fields) {
    names.push_back(field.name);
    EXPECT_EQ(field.values.size(), 9U) << field.name;
  }
  EXPECT_EQ(names, (std::vector<std::string>{"scaled_jacobian", "distortion_jacobian", "certified", "unrepairable",
                                             "accuracy_loss"}));
}

TEST(CellMarks, HoldsTheQualityAndTheCertificates) {
  const HighOrderMesh mesh = testing::read_case("nine_triangles.msh");
  const CellMarks marks(mesh, {}, 1);
  const CellQuality quality = cell_quality(mesh);
  const CellAccuracy accuracy = cell_accuracy(mesh);
  const std::vector<Certificate> certificates = certify(mesh);
  const auto fields = marks.fields();
  for (std::size_t cell = 0; cell < 9; ++cell) {
    EXPECT_EQ(fields[0].values[cell], quality.scaled_jacobian[cell]);
    EXPECT_EQ(fields[1].values[cell], quality.distortion_jacobian[cell]);
    EXPECT_EQ(fields[2].values[cell], certificates[cell].is_valid() ? 1 : -1) << "none is undecided";
    EXPECT_EQ(fields[3].values[cell], 0);
    EXPECT_EQ(fields[4].values[cell], accuracy.loss[cell]);
  }
  EXPECT_EQ(std::ranges::count(fields[2].values, -1), 2);
}

TEST(CellMarks, NumbersTheGroupsFromOneAndGivesACellItsFirst) {
  const HighOrderMesh mesh = testing::read_case("nine_triangles.msh");
  const std::vector<UnrepairableGroup> groups{group_of({3}), group_of({5, 3}), group_of({8})};
  const CellMarks marks(mesh, groups, 1);
  const auto values = marks.fields()[3].values;
  EXPECT_EQ(std::vector<double>(values.begin(), values.end()), (std::vector<double>{0, 0, 0, 1, 0, 2, 0, 0, 3}));
}

// === The physical group ==================================================================================

TEST(MarkUnrepairable, PutsTheGroupsCellsIntoOnePhysicalGroup) {
  const HighOrderMesh before = two_blocks();
  HighOrderMesh mesh = before;
  const std::vector<std::int64_t> numbers = numbers_of(before);
  const std::vector<UnrepairableGroup> groups{group_of({1, 2}),
                                              group_of({static_cast<std::int32_t>(numbers.size()) - 1})};
  mark_unrepairable(mesh, groups);
  EXPECT_EQ(in_group(mesh, "unrepairable"), (std::set<std::int64_t>{numbers[1], numbers[2], numbers.back()}));
  EXPECT_EQ(in_group(mesh, "air"), in_group(before, "air")) << "cells stay in the groups that they were in";
  EXPECT_EQ(in_group(mesh, "left"), in_group(before, "left"));
  EXPECT_EQ(mesh.coordinates, before.coordinates);
  EXPECT_EQ(mesh.node_numbers, before.node_numbers);
}

TEST(MarkUnrepairable, SaysWhichCellEachCellWas) {
  const HighOrderMesh before = two_blocks();
  for (const std::vector<UnrepairableGroup>& groups : {std::vector<UnrepairableGroup>{}, {group_of({0, 3})}}) {
    HighOrderMesh mesh = before;
    const std::vector<std::int32_t> cells = mark_unrepairable(mesh, groups);
    const std::vector<std::int64_t> now = numbers_of(mesh), were = numbers_of(before);
    ASSERT_EQ(cells.size(), now.size());
    for (std::size_t cell = 0; cell < now.size(); ++cell)
      EXPECT_EQ(now[cell], were[static_cast<std::size_t>(cells[cell])]) << cell;
  }
}

TEST(MarkUnrepairable, KeepsEveryElementWithItsNodes) {
  const HighOrderMesh before = two_blocks();
  HighOrderMesh mesh = before;
  mark_unrepairable(mesh, std::vector{group_of({0, 3})});
  const auto elements = [](const HighOrderMesh& of) {
    std::set<std::pair<std::int64_t, std::vector<std::int32_t>>> all;
    for (const ElementBlock& block : of.blocks) {
      const auto nodes = std::size_t(reference::node_count(block.shape, block.order));
      for (std::size_t e = 0; e < block.size(); ++e)
        all.emplace(block.numbers[e], std::vector<std::int32_t>(block.nodes.begin() + std::ptrdiff_t(e * nodes),
                                                                block.nodes.begin() + std::ptrdiff_t((e + 1) * nodes)));
    }
    return all;
  };
  EXPECT_EQ(elements(mesh), elements(before));
}

TEST(MarkUnrepairable, GivesTheMarkedCellsAnEntityOfTheirOwn) {
  HighOrderMesh mesh = two_blocks();
  mark_unrepairable(mesh, std::vector{group_of({0})});
  const ElementBlock& rest = mesh.blocks[0];
  const ElementBlock& marked = mesh.blocks[1];
  EXPECT_EQ(rest.shape, marked.shape);
  EXPECT_EQ(marked.size(), 1U);
  EXPECT_EQ(marked.order, rest.order);
  EXPECT_NE(marked.entity, rest.entity);
  const auto entity = std::ranges::find(mesh.entities, marked.entity, &Entity::tag);
  ASSERT_NE(entity, mesh.entities.end());
  EXPECT_EQ(entity->physical, marked.physical);
  EXPECT_EQ(entity->box, mesh.entities[0].box) << "a copy of the entity that the cells were on";
}

TEST(MarkUnrepairable, ReplacesTheMarksOfAnEarlierRun) {
  HighOrderMesh mesh = two_blocks();
  const std::vector<std::int64_t> numbers = numbers_of(mesh);
  mark_unrepairable(mesh, std::vector{group_of({0})});
  // The order of the cells has changed with the blocks.
  const std::vector<std::int64_t> now = numbers_of(mesh);
  const auto other = std::int32_t(std::ranges::find(now, numbers[3]) - now.begin());
  mark_unrepairable(mesh, std::vector{group_of({other})});
  EXPECT_EQ(in_group(mesh, "unrepairable"), (std::set<std::int64_t>{numbers[3]}));
  EXPECT_EQ(std::ranges::count(mesh.physical_groups, "unrepairable", &PhysicalGroup::name), 1);
}

TEST(MarkUnrepairable, LeavesAMeshWithoutSuchGroupsAsItIs) {
  const HighOrderMesh before = two_blocks();
  HighOrderMesh mesh = before;
  mark_unrepairable(mesh, {});
  EXPECT_EQ(mesh.blocks.size(), before.blocks.size());
  EXPECT_EQ(mesh.physical_groups.size(), before.physical_groups.size());
}

TEST(MarkUnrepairable, ComesBackFromAFile) {
  for (const formats::Format format : {formats::Format::Msh22, formats::Format::Msh41Binary}) {
    HighOrderMesh mesh = two_blocks();
    const std::vector<std::int64_t> numbers = numbers_of(mesh);
    mark_unrepairable(mesh, std::vector{group_of({1, 5})});
    std::string bytes;
    ASSERT_TRUE(formats::write(mesh, format, [&](std::string_view part) {
      bytes += part;
      return true;
    }));
    const auto back = formats::read(bytes);
    ASSERT_TRUE(back) << back.error().sentence;
    EXPECT_EQ(in_group(back->mesh, "unrepairable").size(), 2U);
    EXPECT_EQ(back->mesh.element_count(2), mesh.element_count(2));
  }
}

}  // namespace
}  // namespace varimesh
