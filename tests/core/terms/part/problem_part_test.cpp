// Parts of a problem, one per rank: energy, gradient, blocks and products have the bits of the whole problem's.
#include "core/terms/part/problem_part.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <mutex>
#include <ostream>
#include <vector>

#include "core/options/options.h"
#include "core/ranks/thread_ranks.h"
#include "core/terms/cell_energy.h"
#include "tests/core/support/meshes.h"
#include "tests/core/support/problems.h"

namespace varimesh {
namespace {

using testing::Filling;

struct PartCase {
  Filling filling;
  std::array<int, 3> counts;
  int order;
  double p_norm = 1;
};
void PrintTo(const PartCase& one, std::ostream* out) {
  *out << testing::name(one.filling) << one.order << (one.p_norm == 1 ? "" : "Norm");
}

/// Everything that a CellEnergy says of where the nodes are.
struct Said {
  double scale = 0, value = 0, noise = 0, curvature = 0;
  std::vector<double> gradient, blocks;
  std::vector<float> product;
};

constexpr std::size_t kBlock = 6;

/// Of a whole problem or of a part. `exchange`: brings the direction up to date.
template <class Exchange>
Said ask(CellEnergy& energy, std::size_t own, std::size_t free, int dimension, std::vector<float> direction,
         const Exchange& exchange) {
  const auto d = static_cast<std::size_t>(dimension);
  Said said;
  said.gradient.resize(own * d);
  said.blocks.resize(own * kBlock);
  energy.fit_scale();
  energy.linearise(said.gradient);
  said.scale = energy.scale();
  said.value = energy.value();
  said.noise = energy.noise();
  energy.for_blocks([&](std::int32_t rank, const std::array<double, 6>& block) {
    std::copy_n(block.begin(), kBlock, &said.blocks[static_cast<std::size_t>(rank) * kBlock]);
  });
  direction.resize(free * d + static_cast<std::size_t>(padded(dimension)));
  exchange(direction);
  said.product.resize(direction.size());
  said.curvature = energy.multiply(direction, said.product);
  return said;
}

template <class Number>
bool same_bits(const Number* a, const Number* b, std::size_t count) {
  return std::memcmp(a, b, count * sizeof(Number)) == 0;
}

class PartsOf : public ::testing::TestWithParam<PartCase> {
 protected:
  void SetUp() override {
    HighOrderMesh mesh = testing::grid(GetParam().filling, GetParam().counts, GetParam().order,
                                       testing::bent(testing::is_plane(GetParam().filling) ? 2 : 3));
    testing::shake(mesh, 0.05, 7);
    whole_ = testing::make_problem(mesh);
    kernels_ = make_kernels(material_, whole_.dimension);
    hessian_ = make_hessian_kernels(material_, whole_.dimension);
    for (CellSet& set : whole_.sets) set.delta_squared.assign(static_cast<std::size_t>(set.count), 0.25);
    for (const double component : testing::random_direction(whole_, 3))
      direction_.push_back(static_cast<float>(component));
  }

  Said plain() {
    const Team team(1);
    Said said;
    team.run([&] {
      CellEnergy energy(whole_, *kernels_, *hessian_, PNorm{GetParam().p_norm}, team);
      said =
          ask(energy, whole_.free.size(), whole_.free.size(), whole_.dimension, direction_, [](std::vector<float>&) {});
    });
    return said;
  }

  Said of(ProblemPart& part) const {
    const Team team(1);
    Said said;
    team.run([&] {
      CellEnergy energy(part.problem, *kernels_, *hessian_, PNorm{GetParam().p_norm}, team, &part.share);
      const auto d = static_cast<std::size_t>(whole_.dimension);
      std::vector<float> own;
      for (std::int32_t f = 0; f < part.share.own_nodes; ++f)
        for (std::size_t k = 0; k < d; ++k)
          own.push_back(direction_[static_cast<std::size_t>(part.share.numbers[static_cast<std::size_t>(f)]) * d + k]);
      said = ask(energy, static_cast<std::size_t>(part.share.own_nodes), part.problem.free.size(), whole_.dimension,
                 own, [&](std::vector<float>& direction) {
                   part.share.directions.exchange(direction.data(), d, *part.share.ranks);
                 });
    });
    return said;
  }

  /// How many numbers of this rank's differ from the plain ones.
  int differences(const Said& mine, const Said& all, const ProblemPart& part) const {
    const auto d = static_cast<std::size_t>(whole_.dimension);
    int count = 0;
    for (std::size_t f = 0; f < static_cast<std::size_t>(part.share.own_nodes); ++f) {
      const auto number = static_cast<std::size_t>(part.share.numbers[f]);
      count += same_bits(&mine.gradient[f * d], &all.gradient[number * d], d) ? 0 : 1;
      count += same_bits(&mine.blocks[f * kBlock], &all.blocks[number * kBlock], kBlock) ? 0 : 1;
      count += same_bits(&mine.product[f * d], &all.product[number * d], d) ? 0 : 1;
    }
    return count;
  }

  const Material material_ = material(Options{});
  Problem whole_;
  std::unique_ptr<Kernels> kernels_;
  std::unique_ptr<HessianKernels> hessian_;
  std::vector<float> direction_;
};

INSTANTIATE_TEST_SUITE_P(
    Meshes, PartsOf,
    ::testing::Values(PartCase{Filling::Triangles, {40, 40, 0}, 1}, PartCase{Filling::Quadrilaterals, {40, 40, 0}, 3},
                      PartCase{Filling::MixedPlane, {40, 40, 0}, 2}, PartCase{Filling::Hexahedra, {12, 12, 12}, 2},
                      PartCase{Filling::Prisms, {10, 10, 10}, 1}, PartCase{Filling::Pyramids, {7, 7, 7}, 2},
                      PartCase{Filling::Tetrahedra, {6, 6, 6}, 4}, PartCase{Filling::Tetrahedra, {6, 6, 6}, 2, 2.0},
                      PartCase{Filling::MixedSolid, {8, 8, 8}, 3}),
    [](const auto& info) { return ::testing::PrintToString(info.param); });

TEST_P(PartsOf, HaveTheBitsOfTheWhole) {
  const Said all = plain();
  for (const int count : {1, 2, 3, 5, 8})
    run_as_ranks(count, [&](const Ranks& ranks) {
      ProblemPart part = part_of(whole_, ranks);
      const Said mine = of(part);
      EXPECT_TRUE(same_bits(&mine.scale, &all.scale, 1)) << count;
      EXPECT_TRUE(same_bits(&mine.value, &all.value, 1)) << count << ": " << mine.value - all.value;
      EXPECT_TRUE(same_bits(&mine.noise, &all.noise, 1)) << count;
      EXPECT_TRUE(same_bits(&mine.curvature, &all.curvature, 1)) << count << ": " << mine.curvature - all.curvature;
      EXPECT_EQ(differences(mine, all, part), 0) << count << " ranks, rank " << ranks.rank();
    });
}

TEST_P(PartsOf, HaveEachCellAndFreeNodeOnce) {
  for (const int count : {2, 5}) {
    std::vector<std::vector<int>> cells;
    for (const CellSet& set : whole_.sets) cells.emplace_back(static_cast<std::size_t>(set.count), 0);
    std::vector<int> nodes(whole_.free.size(), 0);
    int workers = 0;
    std::int64_t sent = 0;
    std::mutex mutex;
    run_as_ranks(count, [&](const Ranks& ranks) {
      const ProblemPart part = part_of(whole_, ranks);
      const std::scoped_lock lock(mutex);
      for (std::size_t s = 0; s < cells.size(); ++s)
        for (std::int32_t cell = 0; cell < part.problem.sets[s].count; ++cell)
          ++cells[s][static_cast<std::size_t>(part.cells[s][static_cast<std::size_t>(cell)])];
      for (std::int32_t f = 0; f < part.share.own_nodes; ++f)
        ++nodes[static_cast<std::size_t>(part.share.numbers[static_cast<std::size_t>(f)])];
      workers += part.problem.cells > 0 ? 1 : 0;
      sent += part.share.contributions.items_sent();
    });
    for (const std::vector<int>& of_set : cells) EXPECT_EQ(std::ranges::count(of_set, 1), std::ssize(of_set));
    EXPECT_EQ(std::ranges::count(nodes, 1), std::ssize(nodes));
    EXPECT_EQ(workers, count) << "a mesh that one rank has alone tests nothing";
    EXPECT_GT(sent, 0);
  }
}

TEST_P(PartsOf, SendOneMessageToEachNeighbourPerProductAndDirection) {
  run_as_ranks(5, [&](const Ranks& ranks) {
    ProblemPart part = part_of(whole_, ranks);
    const ProblemShare& share = part.share;
    const Team team(1);
    team.run([&] {
      CellEnergy energy(part.problem, *kernels_, *hessian_, PNorm{}, team, &share);
      const auto d = static_cast<std::size_t>(whole_.dimension);
      std::vector<double> gradient(static_cast<std::size_t>(share.own_nodes) * d);
      energy.linearise(gradient);
      std::vector<float> direction(part.problem.free.size() * d + static_cast<std::size_t>(padded(whole_.dimension)));
      std::vector<float> product = direction;
      const Traffic before = ranks.traffic();
      share.directions.exchange(direction.data(), d, ranks);
      energy.multiply(direction, product);
      const Traffic after = ranks.traffic();
      const auto sends = [](const Halo& halo) {
        return std::ranges::count_if(halo.neighbours(), [](const Halo::Neighbour& one) {
          return std::ranges::any_of(one.arrays, [](const auto& items) { return !items.send.empty(); });
        });
      };
      EXPECT_EQ(after.messages - before.messages, sends(share.directions) + sends(share.contributions));
      EXPECT_EQ(after.bytes - before.bytes,
                (share.directions.items_sent() + share.contributions.items_sent()) * whole_.dimension * 4);
      EXPECT_EQ(after.meetings - before.meetings, 1);
    });
  });
}

TEST_P(PartsOf, FollowTheNodesOfTheWhole) {
  run_as_ranks(3, [&](const Ranks& ranks) {
    Problem copy = whole_;
    ProblemPart part = part_of(copy, ranks);
    for (double& x : copy.positions) x += 0.5;
    part.follow();
    const auto d = static_cast<std::size_t>(whole_.dimension);
    for (std::int32_t f = 0; f < part.share.own_nodes; ++f)
      part.problem.positions[static_cast<std::size_t>(part.problem.free[static_cast<std::size_t>(f)]) * d] += 1;
    part.share.positions.exchange(part.problem.positions.data(), d, ranks);
    for (const std::int32_t node : copy.free) copy.positions[static_cast<std::size_t>(node) * d] += 1;
    for (std::size_t node = 0; node < part.nodes.size(); ++node)
      EXPECT_TRUE(same_bits(&part.problem.positions[node * d],
                            &copy.positions[static_cast<std::size_t>(part.nodes[node]) * d], d));
    std::vector<double> gathered = whole_.positions;
    for (double& x : gathered) x += 0.5;
    gather_positions(part, gathered);
    EXPECT_EQ(gathered, copy.positions);
  });
}

}  // namespace
}  // namespace varimesh
