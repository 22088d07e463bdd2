// Cells that are judged on a device: the certificates and the samples of the processor, bit for bit, and the
// processor's in its place after a fault.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <limits>
#include <numeric>

#include "core/device/cpu_device.h"
#include "core/device_kernels/cell_modules.h"
#include "core/device_kernels/judge/judge_check.h"
#include "core/device_kernels/judge/judge_on_device.h"
#include "core/quality/certified_quality.h"
#include "core/validity/certifier.h"
#include "tests/core/device/fake_card.h"
#include "tests/core/support/meshes.h"

namespace varimesh {
namespace {

using testing::Filling;

/// Whether the processor fuses multiplications and additions in its vectors. If not, it rounds otherwise than a device.
bool fuses() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("fma") != 0;
#else
  return true;
#endif
}

/// Hands everything on, and counts the cells that were measured and sampled.
class Counting final : public detail::MeasuresElsewhere, public detail::SamplesElsewhere {
 public:
  explicit Counting(JudgeOnDevice& judge) : judge_(judge) {}
  bool take(std::span<const double> coordinates) override { return judge_.take(coordinates); }
  bool measure(const detail::MeasureInput& input, std::vector<double>& measures) override {
    const bool is_done = judge_.measure(input, measures);
    if (is_done) measured += input.nodes.size();
    return is_done;
  }
  void forget() override { judge_.forget(); }
  bool sample(const HighOrderMesh& mesh, std::span<const double> coordinates, int intervals, const Team& team,
              std::vector<detail::Extremes>& cells) override {
    const bool is_done = judge_.sample(mesh, coordinates, intervals, team, cells);
    if (is_done) sampled += cells.size();
    return is_done;
  }

  std::size_t measured = 0, sampled = 0;

 private:
  JudgeOnDevice& judge_;
};

std::vector<Certificate> certificates(const HighOrderMesh& mesh, detail::MeasuresElsewhere* elsewhere, double gap,
                                      const Team& team) {
  std::vector<Certificate> found;
  team.run([&] {
    CertificateOptions options;
    options.gap = gap;
    Certifier certifier(mesh, options, team);
    certifier.measure_with(elsewhere);
    found.resize(certifier.cells());
    certifier.certify(mesh.coordinates, found, team);
  });
  return found;
}

void expect_same(const std::vector<Certificate>& ours, const std::vector<Certificate>& theirs) {
  ASSERT_EQ(ours.size(), theirs.size());
  for (std::size_t cell = 0; cell < ours.size(); ++cell) {
    SCOPED_TRACE(cell);
    EXPECT_EQ(ours[cell].answer, theirs[cell].answer);
    if (!fuses()) continue;
    EXPECT_EQ(ours[cell].lower_bound, theirs[cell].lower_bound);
    EXPECT_EQ(ours[cell].upper_bound, theirs[cell].upper_bound);
    EXPECT_EQ(ours[cell].scaled_jacobian_lower_bound, theirs[cell].scaled_jacobian_lower_bound);
    EXPECT_EQ(ours[cell].place, theirs[cell].place);
  }
}

QualityReport report(const HighOrderMesh& mesh, detail::SamplesElsewhere* elsewhere, int intervals, const Team& team) {
  std::optional<Certifier> certifier;
  team.run([&] { certifier.emplace(mesh, CertificateOptions{}, team); });
  return quality(mesh, *certifier, certificates(mesh, nullptr, 1e300, team), intervals, team, one_rank(), elsewhere);
}

void expect_same(const QualityReport& ours, const QualityReport& theirs) {
  EXPECT_EQ(ours.invalid_elements, theirs.invalid_elements);
  EXPECT_EQ(ours.histogram, theirs.histogram);
  if (!fuses()) return;
  EXPECT_EQ(ours.min_scaled_jacobian, theirs.min_scaled_jacobian);
  EXPECT_EQ(ours.mean_scaled_jacobian, theirs.mean_scaled_jacobian);
  EXPECT_EQ(ours.min_distortion_jacobian, theirs.min_distortion_jacobian);
  ASSERT_EQ(ours.invalid.size(), theirs.invalid.size());
  for (std::size_t i = 0; i < ours.invalid.size(); ++i) {
    EXPECT_EQ(ours.invalid[i].number, theirs.invalid[i].number);
    EXPECT_EQ(ours.invalid[i].place, theirs.invalid[i].place);
  }
}

/// Valid cells, invalid ones and some between. `shake` is relative to what cells of the order bear.
HighOrderMesh shaken(Filling filling, int order, double shake) {
  HighOrderMesh mesh = testing::grid(filling, {3, 2, 2}, order, testing::bent(testing::is_plane(filling) ? 2 : 3));
  testing::shake(mesh, shake / (order * order), 7);
  return mesh;
}

struct JudgedCase {
  Filling filling;
  int order;
};
void PrintTo(const JudgedCase& one, std::ostream* out) { *out << testing::name(one.filling) << one.order; }

std::vector<JudgedCase> judged_cases() {
  std::vector<JudgedCase> all;
  for (const Filling filling : testing::kFillings)
    for (int order = 1; order <= (testing::is_plane(filling) ? 6 : 4); ++order) all.push_back({filling, order});
  return all;
}

class JudgedOnADevice : public ::testing::TestWithParam<JudgedCase> {
 protected:
  device::RunDevice device_{device::make_cpu_device()};
  const Team team_{2};
};
INSTANTIATE_TEST_SUITE_P(Cases, JudgedOnADevice, ::testing::ValuesIn(judged_cases()), [](const auto& info) {
  return std::string(testing::name(info.param.filling)) + std::to_string(info.param.order);
});

TEST_P(JudgedOnADevice, HaveTheProcessorsCertificates) {
  int valid = 0, others = 0;
  for (const double shake : {0.02, 0.12, 0.5}) {
    const HighOrderMesh mesh = shaken(GetParam().filling, GetParam().order, shake);
    for (const double gap : {std::numeric_limits<double>::infinity(), 0.05}) {
      JudgeOnDevice judge(device_, mesh.dimension);
      Counting counting(judge);
      const auto theirs = certificates(mesh, nullptr, gap, team_);
      expect_same(certificates(mesh, &counting, gap, team_), theirs);
      EXPECT_EQ(counting.measured, theirs.size()) << "all cells were measured on the device";
      for (const Certificate& one : theirs) ++(one.is_valid() ? valid : others);
    }
  }
  EXPECT_GT(valid, 0);
  EXPECT_TRUE(others > 0 || GetParam().order == 1);
  EXPECT_FALSE(device_.fault());
}

TEST_P(JudgedOnADevice, HaveTheProcessorsSamples) {
  for (const double shake : {0.02, 0.5})
    for (const int intervals : {0, 3}) {
      const HighOrderMesh mesh = shaken(GetParam().filling, GetParam().order, shake);
      JudgeOnDevice judge(device_, mesh.dimension);
      Counting counting(judge);
      expect_same(report(mesh, &counting, intervals, team_), report(mesh, nullptr, intervals, team_));
      EXPECT_EQ(counting.sampled, mesh.element_count(mesh.dimension));
    }
}

class Judge : public ::testing::Test {
 protected:
  void TearDown() override { unsetenv("FAKE_CUDA"); }

  /// Expects that the mesh is judged as on the processor.
  void expect_as_on_the_processor(const HighOrderMesh& mesh) {
    JudgeOnDevice judge(device_, mesh.dimension);
    Counting counting(judge);
    expect_same(certificates(mesh, &counting, 0.1, team_), certificates(mesh, nullptr, 0.1, team_));
    expect_same(report(mesh, &counting, 0, team_), report(mesh, nullptr, 0, team_));
    EXPECT_EQ(counting.measured, mesh.element_count(mesh.dimension));
    EXPECT_EQ(counting.sampled, mesh.element_count(mesh.dimension));
  }

  device::RunDevice device_{device::make_cpu_device()};
  const Team team_{1};
};

TEST_F(Judge, JudgesMeshesThatAreNumberedClockwiseAndFarAwayAndTiny) {
  HighOrderMesh mesh = shaken(Filling::Tetrahedra, 3, 0.1);
  HighOrderMesh mirrored = mesh, far = mesh, tiny = mesh;
  for (std::size_t i = 0; i < mesh.coordinates.size(); ++i) {
    if (i % 3 == 0) mirrored.coordinates[i] = -mesh.coordinates[i];
    far.coordinates[i] += 1e6;
    tiny.coordinates[i] *= 1e-9;
  }
  for (const HighOrderMesh& one : {mirrored, far, tiny}) expect_as_on_the_processor(one);
}

TEST_F(Judge, JudgesSmallMeshes) {
  for (const Filling filling : testing::kFillings)
    expect_as_on_the_processor(testing::grid(filling, {1, 1, 1}, 2, testing::bent(testing::is_plane(filling) ? 2 : 3)));
}

TEST_F(Judge, FindsTheOneCellThatIsInverted) {
  HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {4, 3, 3}, 2, testing::bent(3));
  const ElementBlock& block = *std::ranges::find(mesh.blocks, Shape::Hexahedron, &ElementBlock::shape);
  const std::int32_t* const nodes = &block.nodes[17 * 27];
  for (int c = 0; c < 3; ++c) std::swap(mesh.coordinates[3 * nodes[26] + c], mesh.coordinates[3 * nodes[6] + c]);
  expect_as_on_the_processor(mesh);
  JudgeOnDevice judge(device_, 3);
  const auto found = certificates(mesh, &judge, std::numeric_limits<double>::infinity(), team_);
  EXPECT_FALSE(found[17].is_valid());
  EXPECT_TRUE(found[0].is_valid());
}

TEST_F(Judge, CertifiesNothingThatIsNotFinite) {
  HighOrderMesh mesh = testing::grid(Filling::Tetrahedra, {2, 2, 2}, 2, testing::bent(3));
  for (const double wrong : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    HighOrderMesh broken = mesh;
    broken.coordinates[3 * mesh.blocks.back().nodes.back() + 1] = wrong;
    JudgeOnDevice judge(device_, 3);
    const auto ours = certificates(broken, &judge, 1e300, team_), theirs = certificates(broken, nullptr, 1e300, team_);
    for (std::size_t cell = 0; cell < ours.size(); ++cell) EXPECT_EQ(ours[cell].answer, theirs[cell].answer);
    EXPECT_FALSE(are_valid(ours));
  }
}

TEST_F(Judge, CertifiesOnlyTheCellsThatAreNamed) {
  const HighOrderMesh mesh = shaken(Filling::MixedSolid, 3, 0.1);
  JudgeOnDevice judge(device_, 3);
  Counting counting(judge);
  Certifier certifier(mesh);
  const auto all = certificates(mesh, nullptr, std::numeric_limits<double>::infinity(), team_);
  std::vector<std::int32_t> named;
  for (std::size_t cell = 1; cell < certifier.cells(); cell += 3) named.push_back(static_cast<std::int32_t>(cell));
  certifier.measure_with(&counting);
  std::vector<Certificate> some(all.size());
  certifier.certify(mesh.coordinates, named, some, team_);
  EXPECT_EQ(counting.measured, named.size());
  std::vector<Certificate> expected(all.size());
  for (const std::int32_t cell : named) expected[static_cast<std::size_t>(cell)] = all[static_cast<std::size_t>(cell)];
  expect_same(some, expected);
  certifier.certify(mesh.coordinates, std::span(named).first(2), some, team_);
  EXPECT_EQ(counting.measured, named.size()) << "for few cells the coordinates of all nodes are not copied";
}

/// The cells of each kind in blocks of at most `most` cells, and the blocks of all kinds in turns.
HighOrderMesh in_small_blocks(HighOrderMesh mesh, std::size_t most) {
  const std::vector<ElementBlock> whole = std::exchange(mesh.blocks, {});
  for (std::size_t first = 0, added = 1; added > 0; first += most) {
    added = 0;
    for (const ElementBlock& block : whole) {
      const std::size_t end = std::min(first + most, block.size());
      const auto nodes = static_cast<std::size_t>(reference::node_count(block.shape, block.order));
      if (first >= end) continue;
      ++added;
      const auto part = [&](const auto& list, std::size_t each) {
        return std::decay_t<decltype(list)>(list.begin() + static_cast<std::ptrdiff_t>(first * each),
                                            list.begin() + static_cast<std::ptrdiff_t>(end * each));
      };
      ElementBlock& small = mesh.blocks.emplace_back(block);
      small.nodes = part(block.nodes, nodes);
      small.numbers = part(block.numbers, 1);
    }
  }
  return mesh;
}

TEST_F(Judge, JudgesCellsOfManySmallBlocks) {
  const HighOrderMesh mesh = in_small_blocks(shaken(Filling::MixedSolid, 2, 0.3), 5);
  ASSERT_GT(mesh.blocks.size(), 8U);
  expect_as_on_the_processor(mesh);
  JudgeOnDevice judge(device_, 3);
  std::vector<detail::Extremes> cells(mesh.element_count(3));
  ASSERT_TRUE(judge.sample(mesh, mesh.coordinates, 4, team_, cells));
  // Each block by itself, as a mesh.
  HighOrderMesh single = mesh;
  std::size_t first = 0;
  for (const ElementBlock& block : mesh.blocks) {
    if (reference::info(block.shape).dimension != 3) continue;
    single.blocks = {block};
    std::vector<detail::Extremes> own(block.size());
    ASSERT_TRUE(judge.sample(single, mesh.coordinates, 4, team_, own));
    for (std::size_t i = 0; i < own.size(); ++i) EXPECT_EQ(own[i].low, cells[first + i].low) << first + i;
    first += block.size();
  }
  EXPECT_EQ(first, cells.size());
}

TEST_F(Judge, SamplesLargeTablesInRanges) {
  const HighOrderMesh mesh = testing::grid(Filling::Hexahedra, {1, 1, 1}, 6, testing::bent(3));
  JudgeOnDevice judge(device_, 3);
  ASSERT_GT(detail::lattice_table(Shape::Hexahedron, 6, 16, 3).ranges(), 1U);
  std::vector<detail::Extremes> cells(1);
  ASSERT_TRUE(judge.sample(mesh, mesh.coordinates, 16, team_, cells));
  expect_same(report(mesh, &judge, 16, team_), report(mesh, nullptr, 16, team_));
}

class JudgedOnACard : public Judge {
 protected:
  void SetUp() override {
    if (device::judge_kernels(3).packed.empty())
      GTEST_SKIP() << "this build has no kernels for a card, because there was no clang";
  }
};

TEST_F(JudgedOnACard, HaveTheProcessorsBitsWhateverFails) {
  const HighOrderMesh mesh = shaken(Filling::MixedSolid, 2, 0.3);
  const auto theirs = certificates(mesh, nullptr, 0.1, team_);
  const QualityReport their_report = report(mesh, nullptr, 0, team_);
  int failed = 0, ended = 0;
  for (const std::string state :
       {"", "memory=1000", "memory=20000", "memory=100000", "load=218", "launch=701", "lost=1", "lost=4", "lost=9",
        "lost=15", "lost_at_wait=2", "lost_at_wait=8", "lost_at_wait=23"}) {
    SCOPED_TRACE(state);
    auto card = testing::fake_card(state.c_str());
    ASSERT_TRUE(card);
    device::RunDevice device(std::move(*card));
    JudgeOnDevice judge(device, 3);
    expect_same(certificates(mesh, &judge, 0.1, team_), theirs);
    expect_same(report(mesh, &judge, 0, team_), their_report);
    EXPECT_EQ(device.fault().has_value(), !state.empty());
    EXPECT_EQ(device.done_on(), "") << "no step was made";
    if (device.fault()) {
      ++failed;
      EXPECT_EQ(device.fault()->sentence.back(), '.');
    }
    if (device.has_ended()) ++ended;
  }
  EXPECT_EQ(failed, 12);
  EXPECT_EQ(ended, 9) << "other work may need less memory";
}

TEST_F(JudgedOnACard, AreCheckedBeforeTheyAreTrusted) {
  const auto well = testing::fake_card(""), wrong = testing::fake_card("wrong");
  setenv("FAKE_CUDA", "", 1);
  const auto checked = check_judgement(**well);
  EXPECT_TRUE(checked) << checked.error().sentence;
  setenv("FAKE_CUDA", "wrong", 1);
  const auto found = check_judgement(**wrong);
  ASSERT_FALSE(found);
  EXPECT_EQ(found.error().kind, device::Fault::Kind::BadKernels);
  EXPECT_NE(found.error().sentence.find("on tetrahedra of order 2."), std::string::npos) << found.error().sentence;
}

TEST_F(JudgedOnACard, TakeTheCardAgainOnceItHasRoom) {
  const HighOrderMesh mesh = shaken(Filling::Tetrahedra, 3, 0.1);
  auto card = testing::fake_card("memory=1000");
  ASSERT_TRUE(card);
  device::RunDevice device(std::move(*card));
  JudgeOnDevice judge(device, 3);
  EXPECT_FALSE(judge.take(mesh.coordinates));
  setenv("FAKE_CUDA", "", 1);
  EXPECT_TRUE(judge.take(mesh.coordinates));
  judge.forget();
}

}  // namespace
}  // namespace varimesh
