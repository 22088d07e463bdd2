// The nodes of lower orders are those of the mesh of this order.
#include "core/solvers/descent/form/order_space.h"

#include <gtest/gtest.h>

#include <map>

#include "core/mesh/changes/change_order.h"
#include "core/mesh/connectivity.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

class OrderSpaceOf : public ::testing::TestWithParam<Filling> {
 protected:
  const HighOrderMesh mesh_ =
      testing::grid(GetParam(), {3, 3, 3}, 5, testing::bent(testing::is_plane(GetParam()) ? 2 : 3));
  const Problem problem_ = testing::make_problem(mesh_);
};

INSTANTIATE_TEST_SUITE_P(Fillings, OrderSpaceOf, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& filling) { return std::string(testing::name(filling.param)); });

TEST_P(OrderSpaceOf, NumbersEachNodeOfTheMeshOfALowerOrderOnce) {
  for (int order = 1; order < 5; ++order) {
    const OrderSpace space = lower_space(problem_, order, Team(1));
    const HighOrderMesh lowered = change_order(mesh_, order).value();
    const std::vector<bool> fixed = fixed_nodes(lowered);
    const Cells cells(lowered, lowered.dimension);
    std::map<std::int32_t, std::int32_t> number_of, node_of;
    for (std::size_t s = 0; s < space.sets.size(); ++s)
      for (std::int32_t cell = 0; cell < problem_.sets[s].count; ++cell) {
        const auto nodes = cells.nodes(problem_.sets[s].mesh_cell[cell]);
        for (std::size_t i = 0; i < nodes.size(); ++i) {
          const std::int32_t number = space.sets[s].numbers[static_cast<std::size_t>(cell) * nodes.size() + i];
          EXPECT_EQ(number < 0, fixed[nodes[i]]) << "order " << order;
          EXPECT_EQ(number_of.emplace(nodes[i], number).first->second, number) << "order " << order;
          if (number < 0) continue;
          EXPECT_EQ(node_of.emplace(number, nodes[i]).first->second, nodes[i]) << "order " << order;
        }
      }
    EXPECT_EQ(node_of.size(), static_cast<std::size_t>(space.count));
  }
}

TEST_P(OrderSpaceOf, DoesNotDependOnTheNumberOfThreads) {
  const Team one(1), three(3);
  for (const int order : {2, 5}) {
    const auto made = [&](const Team& team) {
      return order < 5 ? lower_space(problem_, order, team) : own_space(problem_, team);
    };
    const OrderSpace a = made(one), b = made(three);
    EXPECT_EQ(a.begin, b.begin);
    EXPECT_EQ(a.places, b.places);
    EXPECT_EQ(a.place_count, b.place_count);
    for (std::size_t s = 0; s < a.sets.size(); ++s) {
      EXPECT_EQ(a.sets[s].numbers, b.sets[s].numbers);
      EXPECT_EQ(a.sets[s].is_first, b.sets[s].is_first);
    }
  }
}

}  // namespace
}  // namespace varimesh
