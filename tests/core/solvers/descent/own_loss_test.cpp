// In a mesh that came in valid, no cell pays with its own loss for the sum.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/optimise/optimiser.h"
#include "core/quality/accuracy/accuracy.h"
#include "tests/core/support/cases.h"

namespace varimesh {
namespace {

/// By cell: its part of the local loss (docs/descent.md, "What is minimised"), [Σ_s κ^(2(P+1−s)) m_s²]^½.
std::vector<double> own_losses(const HighOrderMesh& mesh) {
  const CellAccuracy cells = cell_accuracy(mesh, 1);
  const double kappa = std::pow(double(cells.loss.size()), -1.0 / mesh.dimension);
  std::vector<double> result;
  for (std::size_t c = 0; c < cells.loss.size(); ++c) {
    double sum = 0;
    for (std::size_t k = 0; k < cells.parts; ++k)
      sum += std::pow(kappa, 2 * double(cells.parts - k)) * std::pow(cells.modal_parts[c * cells.parts + k], 2);
    result.push_back(std::sqrt(sum));
  }
  return result;
}

double root_mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / double(values.size()));
}

class OwnLoss : public ::testing::TestWithParam<const char*> {};

// A cell that is straight-sided has no loss, and has to bend if the cell in front of it hands on a part of its
// curvature. So its loss may rise, but not above the loss of the worst cell before, and no cell that was worse than the
// mean then doubles its loss.
TEST_P(OwnLoss, OfTheWorstCellFalls) {
  const HighOrderMesh mesh = testing::read_case(GetParam());
  Options options;
  options.threads = 1;
  const auto result = optimise(mesh, options);
  ASSERT_TRUE(result);
  const std::vector<double> before = own_losses(mesh), after = own_losses(result->mesh);
  const double mean = root_mean_square(before);
  EXPECT_LT(root_mean_square(after), .99 * mean);
  EXPECT_LT(std::ranges::max(after), std::ranges::max(before));
  for (std::size_t c = 0; c < before.size(); ++c)
    EXPECT_LT(after[c], 2 * std::max(before[c], mean)) << "cell " << c << " of " << before.size();
}

INSTANTIATE_TEST_SUITE_P(ValidMeshes, OwnLoss,
                         ::testing::Values("annulus_p3.msh", "disc_p4.msh", "aerofoil_p4.msh", "aerofoil_far_p4.msh"),
                         [](const auto& info) {
                           std::string name = info.param;
                           return name.substr(0, name.find('.'));
                         });

}  // namespace
}  // namespace varimesh
