// The loss and its preconditioner by several ranks: every number has the bits of one process.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "core/base/index.h"
#include "core/quality/accuracy/team_accuracy.h"
#include "core/ranks/thread_ranks.h"
#include "core/solvers/descent/form/order_levels.h"
#include "core/terms/part/problem_part.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

struct FormCase {
  Filling filling;
  std::array<int, 3> counts;
  int order;
};
void PrintTo(const FormCase& one, std::ostream* out) { *out << testing::name(one.filling) << one.order; }

/// The form and its preconditioner, of a whole problem or of a part.
struct FormAndLevels {
  FormAndLevels(const Problem& problem, double wave, const Team& team, const ProblemPart* part = nullptr)
      : space(own_space(problem, team, part)),
        form(problem, space, wave, team, {}, part),
        levels(problem, space, team, part) {}

  OrderSpace space;
  ModalForm form;
  OrderLevels levels;
};

/// What a bench says, with `numbers` by free node.
struct SaidOfForm {
  double value = 0, along = 0;
  std::vector<double> losses, gradient, product, solution;

  SaidOfForm(FormAndLevels& bench, const Problem& problem, std::vector<double> direction,
             const std::vector<double>& stiffness) {
    gradient.resize(direction.size());
    product.resize(direction.size());
    solution.resize(direction.size());
    value = bench.form.gradient(gradient);
    losses.assign(bench.form.squared_losses().begin(),
                  bench.form.squared_losses().begin() + static_cast<std::ptrdiff_t>(problem.cells));
    bench.form.multiply(direction, product);
    bench.levels.take_diagonals(bench.form, stiffness);
    along = bench.levels.apply(direction, solution);
  }
};

class FormOfRanks : public ::testing::TestWithParam<FormCase> {
 protected:
  void SetUp() override {
    const FormCase& one = GetParam();
    HighOrderMesh mesh =
        testing::grid(one.filling, one.counts, one.order, testing::bent(testing::is_plane(one.filling) ? 2 : 3));
    testing::shake(mesh, 0.05, 7);
    wave_ = local_wave(mesh);
    whole_ = testing::make_problem(mesh);
    direction_ = testing::random_direction(whole_, 3);
    for (std::int32_t cell = 0; cell < whole_.cells; ++cell) stiffness_.push_back(1e-4 * (1 + cell % 7));
  }

  std::vector<double> direction_of(const ProblemPart& part, bool others) const {
    const std::size_t d = at(whole_.dimension);
    std::vector<double> direction;
    for (std::size_t f = 0; f < part.problem.free.size(); ++f)
      for (std::size_t k = 0; k < d; ++k)
        direction.push_back(others || f < at(part.share.own_nodes) ? direction_[at(part.share.numbers[f]) * d + k]
                                                                   : 1e300);
    return direction;
  }
  std::vector<double> stiffness_of(const ProblemPart& part) const {
    std::vector<double> stiffness;
    for (std::size_t s = 0; s < part.cells.size(); ++s)
      for (std::int32_t cell = 0; cell < part.problem.sets[s].count; ++cell)
        stiffness.push_back(stiffness_[at(whole_.sets[s].first + part.cells[s][at(cell)])]);
    return stiffness;
  }

  /// How many numbers of own nodes differ.
  int differences(const ProblemPart& part, const std::vector<double>& mine, const std::vector<double>& all) const {
    const std::size_t d = at(whole_.dimension);
    int count = 0;
    for (std::size_t f = 0; f < at(part.share.own_nodes); ++f)
      count += std::memcmp(&mine[f * d], &all[at(part.share.numbers[f]) * d], d * sizeof(double)) == 0 ? 0 : 1;
    return count;
  }

  double wave_ = 0;
  Problem whole_;
  std::vector<double> direction_, stiffness_;
};

INSTANTIATE_TEST_SUITE_P(
    Meshes, FormOfRanks,
    ::testing::Values(FormCase{Filling::Triangles, {40, 40, 0}, 1}, FormCase{Filling::Triangles, {20, 20, 0}, 5},
                      FormCase{Filling::Quadrilaterals, {40, 40, 0}, 3}, FormCase{Filling::MixedPlane, {37, 41, 0}, 4},
                      FormCase{Filling::Hexahedra, {11, 11, 11}, 2}, FormCase{Filling::Prisms, {9, 9, 9}, 3},
                      FormCase{Filling::Pyramids, {6, 6, 6}, 2}, FormCase{Filling::Tetrahedra, {5, 5, 5}, 4},
                      FormCase{Filling::MixedSolid, {7, 7, 7}, 3}, FormCase{Filling::MixedSolid, {2, 2, 2}, 2},
                      FormCase{Filling::Triangles, {3, 3, 0}, 4}));

TEST_P(FormOfRanks, HasTheBitsOfOneProcess) {
  const Team one(1);
  FormAndLevels bench(whole_, wave_, one);
  const SaidOfForm plain(bench, whole_, direction_, stiffness_);
  EXPECT_EQ(plain.value > 0, GetParam().order > 1);
  for (const int count : {1, 2, 3, 5, 8})
    run_as_ranks(count, [&](const Ranks& ranks) {
      const Team team(count == 2 ? 2 : 1);
      ProblemPart part = part_of(whole_, ranks);
      team.run([&] {
        FormAndLevels mine(part.problem, wave_, team, &part);
        const std::string who = std::to_string(count) + " ranks, rank " + std::to_string(ranks.rank());
        std::vector<double> stiffness = stiffness_of(part);
        // The numbers of others come by themselves for the preconditioner, and by the caller's exchange for products.
        const SaidOfForm said(mine, part.problem, direction_of(part, true), stiffness);
        EXPECT_EQ(said.value, plain.value) << who;
        EXPECT_EQ(said.along, plain.along) << who;
        EXPECT_EQ(differences(part, said.gradient, plain.gradient), 0) << who;
        EXPECT_EQ(differences(part, said.product, plain.product), 0) << who;
        EXPECT_EQ(differences(part, said.solution, plain.solution), 0) << who;
        std::vector<double> alone = direction_of(part, false), solution(alone.size());
        EXPECT_EQ(mine.levels.apply(alone, solution), plain.along) << who;
        EXPECT_EQ(differences(part, solution, plain.solution), 0) << who;
        std::vector<double> losses(at(whole_.cells));
        gather_cells<double>(part, std::span(said.losses), losses);
        EXPECT_EQ(losses, plain.losses) << who;
      });
    });
}

TEST_P(FormOfRanks, SendsOneMessageToEachNeighbourAtATime) {
  run_as_ranks(3, [&](const Ranks& ranks) {
    const Team team(1);
    ProblemPart part = part_of(whole_, ranks);
    FormAndLevels mine(part.problem, wave_, team, &part);
    std::vector<double> direction = direction_of(part, true), product(direction.size());
    const auto sent_by = [&](const auto& work) {
      const std::int64_t before = ranks.traffic().messages;
      work();
      return ranks.traffic().messages - before;
    };
    const auto sent_to = [](const Halo& halo) {
      return std::ranges::count_if(
          halo.neighbours(), [](const Halo::Neighbour& neighbour) { return !neighbour.arrays.front().send.empty(); });
    };
    EXPECT_EQ(sent_by([&] { mine.form.multiply(direction, product); }), sent_to(mine.space.share.contributions));
    mine.levels.take_diagonals(mine.form, stiffness_of(part));
    std::int64_t expected = 0;
    const auto spaces = mine.levels.spaces();
    for (std::size_t level = 0; level + 1 < spaces.size(); ++level)
      expected += sent_to(spaces[level]->share.contributions) + sent_to(spaces[level]->share.values) +
                  sent_to(spaces[level + 1]->share.to_first) + sent_to(spaces[level + 1]->share.from_first);
    EXPECT_EQ(sent_by([&] { mine.levels.apply(direction, product); }), expected);
    EXPECT_EQ(ranks.any(expected > 0), GetParam().order > 1 && (whole_.cells > 256 || whole_.sets.size() > 1));
  });
}

TEST_P(FormOfRanks, DividesTheNodesOfAllOrders) {
  const Team team(1);
  for (int order = 1; order < GetParam().order; ++order) {
    const OrderSpace whole = lower_space(whole_, order, team);
    run_as_ranks(3, [&](const Ranks& ranks) {
      const ProblemPart part = part_of(whole_, ranks);
      const OrderSpace mine = lower_space(part.problem, order, team, &part);
      EXPECT_EQ(ranks.sum(std::int64_t{mine.own_count}), whole.count);
      // Each free node has one first place, on one rank, and it is the one of the whole space.
      std::int64_t firsts = 0, wrong = 0;
      for (std::size_t s = 0; s < mine.sets.size(); ++s) {
        const std::size_t nodes = at(mine.sets[s].nodes_per_cell);
        for (std::size_t i = 0; i < at(part.problem.sets[s].count) * nodes; ++i) {
          const std::size_t in_whole = at(part.cells[s][i / nodes]) * nodes + i % nodes;
          firsts += mine.sets[s].is_first[i];
          wrong += mine.sets[s].is_first[i] != whole.sets[s].is_first[in_whole] ? 1 : 0;
        }
      }
      EXPECT_EQ(ranks.sum(firsts), whole.count);
      EXPECT_EQ(wrong, 0);
    });
  }
}

}  // namespace
}  // namespace varimesh
