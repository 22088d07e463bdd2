// Ranks that all have the mesh share certificates, samples and losses of its cells, with the bits of one process.
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "core/quality/accuracy/team_accuracy.h"
#include "core/quality/sample_cells.h"
#include "core/ranks/thread_ranks.h"
#include "core/validity/certifier.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

class SharedByRanks : public ::testing::TestWithParam<Filling> {
 protected:
  void SetUp() override {
    const bool plane = testing::is_plane(GetParam());
    mesh_ =
        testing::grid(GetParam(), plane ? std::array{23, 19, 0} : std::array{6, 7, 7}, 3, testing::bent(plane ? 2 : 3));
    testing::shake(mesh_, 0.02, 7);
  }
  /// Calls use(ranks) on each of three ranks, and expects that the ranks have met in it.
  template <class Use>
  static void on_ranks(const Use& use) {
    run_as_ranks(3, [&](const Ranks& ranks) {
      use(ranks);
      EXPECT_GT(ranks.traffic().messages, 0);
    });
  }

  HighOrderMesh mesh_;
};

INSTANTIATE_TEST_SUITE_P(Fillings, SharedByRanks, ::testing::ValuesIn(testing::kFillings),
                         [](const auto& filling) { return std::string(testing::name(filling.param)); });

TEST_P(SharedByRanks, Certificates) {
  const Team one(1);
  const Certifier certifier(mesh_);
  std::vector<Certificate> alone(certifier.cells());
  certifier.certify(mesh_.coordinates, alone, one);
  EXPECT_FALSE(are_valid(alone));
  on_ranks([&](const Ranks& ranks) {
    std::vector<Certificate> shared(certifier.cells());
    certifier.certify(mesh_.coordinates, shared, Team(1), ranks);
    int differences = 0;
    for (std::size_t cell = 0; cell < alone.size(); ++cell)
      differences += shared[cell].answer == alone[cell].answer && shared[cell].lower_bound == alone[cell].lower_bound &&
                             shared[cell].upper_bound == alone[cell].upper_bound &&
                             shared[cell].scaled_jacobian_lower_bound == alone[cell].scaled_jacobian_lower_bound &&
                             shared[cell].place == alone[cell].place
                         ? 0
                         : 1;
    EXPECT_EQ(differences, 0);
  });
}

TEST_P(SharedByRanks, Samples) {
  const std::vector<detail::CellBatch> batches = detail::batches_to_sample(mesh_);
  std::vector<detail::Extremes> alone(mesh_.element_count(mesh_.dimension));
  detail::sample_cells(mesh_, mesh_.coordinates, 8, batches, Team(1), alone);
  on_ranks([&](const Ranks& ranks) {
    std::vector<detail::Extremes> shared(alone.size());
    EXPECT_TRUE(detail::SamplesOfRanks(ranks).sample(mesh_, mesh_.coordinates, 8, Team(1), shared));
    EXPECT_EQ(std::memcmp(shared.data(), alone.data(), alone.size() * sizeof alone[0]), 0);
  });
}

TEST_P(SharedByRanks, Losses) {
  const CellAccuracy alone = cell_accuracy(mesh_, Team(1));
  const double loss = local_loss(mesh_, mesh_.coordinates, Team(1));
  const double mean = accuracy(mesh_, mesh_.coordinates, Team(1)).loss;
  EXPECT_GT(loss, 0);
  on_ranks([&](const Ranks& ranks) {
    const CellAccuracy shared = cell_accuracy(mesh_, Team(1), ranks);
    EXPECT_EQ(shared.modal_parts, alone.modal_parts);
    EXPECT_EQ(shared.volumes, alone.volumes);
    EXPECT_EQ(local_loss(mesh_, mesh_.coordinates, Team(1), ranks), loss);
    EXPECT_EQ(accuracy(mesh_, mesh_.coordinates, Team(1), one_rank(), ranks).loss, mean);
  });
}

}  // namespace
}  // namespace varimesh
