#include "core/slide/coupled/coupled.h"

#include <gtest/gtest.h>

#include "core/optimise/optimiser.h"
#include "core/slide/coupled/coupled_newton.h"
#include "core/slide/coupled/hold_back.h"
#include "core/slide/on_file/slide_on_file.h"
#include "core/slide/slide.h"
#include "tests/core/support/disc_mesh.h"

namespace varimesh {
namespace {

using testing::DiscMesh;
using testing::solid_cylinder;

GeometryOptions coupled() {
  GeometryOptions options;
  options.slide = SlideOn::Coupled;
  return options;
}

SlideReport slid(HighOrderMesh& mesh, const GeometryOptions& options) {
  const auto done = slide_on_model(mesh, options, solid_cylinder());
  EXPECT_TRUE(done) << done.error().sentence;
  return done ? done->report : SlideReport();
}

std::int64_t left_after_optimising(const HighOrderMesh& mesh) {
  const auto result = optimise(mesh);
  EXPECT_TRUE(result);
  return result->after.certified.invalid + result->after.certified.undecided;
}

TEST(Coupled, MakesRoomWhereBottomUpSlidingCannot) {
  const HighOrderMesh start = DiscMesh(2, 3).mesh();
  HighOrderMesh bottom_up = start, all = start;
  slid(bottom_up, {});
  const SlideReport report = slid(all, coupled());
  EXPECT_GT(left_after_optimising(bottom_up), 0);
  EXPECT_EQ(left_after_optimising(all), 0);
  EXPECT_LE(report.after.largest, 2 * report.before.largest);
  EXPECT_LE(report.after.rms, 2 * report.before.rms);
}

TEST(Coupled, KeepsNodesOnTheirEntities) {
  const HighOrderMesh start = DiscMesh(2, 3).mesh();
  HighOrderMesh mesh = start;
  EXPECT_GT(slid(mesh, coupled()).nodes, 0);
  for (std::size_t block = 0; block < 3; ++block)
    for (const std::int32_t node : start.blocks[block].nodes) {
      const double* x = &mesh.coordinates[3 * static_cast<std::size_t>(node)];
      if (block == 0) {
        EXPECT_NEAR(std::hypot(x[0], x[1]), 1, 1e-13);
      } else {
        EXPECT_NEAR(x[2], block == 1 ? 0 : 1, 1e-15);
      }
    }
}

TEST(Coupled, KeepsWithinATolerance) {
  const HighOrderMesh start = DiscMesh(2, 3).mesh();
  HighOrderMesh bottom_up = start;
  const SlideReport before = slid(bottom_up, {});
  bool taken = false;
  for (const double tolerance : {1e-9, 1.5 * before.after.largest, 4 * before.after.largest}) {
    HighOrderMesh mesh = start;
    GeometryOptions options = coupled();
    options.tolerance = tolerance;
    const SlideReport report = slid(mesh, options);
    EXPECT_LE(report.after.largest, std::max(tolerance, before.after.largest) + 1e-11) << tolerance;
    EXPECT_LE(report.after.rms, std::max(tolerance, before.after.rms) + 1e-11) << tolerance;
    taken = taken || mesh.coordinates != bottom_up.coordinates;
  }
  EXPECT_TRUE(taken) << "all nodes have never moved together";
}

TEST(Coupled, HasTheSameBitsForAnyNumberOfThreads) {
  // Loops over cells hand out 512 at a time, and sums 16,384 numbers.
  const HighOrderMesh start = DiscMesh(6, 3).mesh();
  ASSERT_GT(start.element_count(3), 1024u);
  ASSERT_GT(3 * start.node_count(), 16'384u);
  std::vector<double> of[3];
  for (int threads = 1; threads <= 3; ++threads) {
    HighOrderMesh mesh = start;
    GeometryOptions options = coupled();
    options.threads = threads;
    slid(mesh, options);
    of[threads - 1] = mesh.coordinates;
  }
  EXPECT_NE(of[0], start.coordinates);
  EXPECT_EQ(of[0], of[1]);
  EXPECT_EQ(of[0], of[2]);
}

TEST(Coupled, LeavesTheMeshAsItCameIfItIsToStop) {
  const HighOrderMesh start = DiscMesh(1, 3).mesh();
  int looks = 0;
  const auto slides = [&](int most) {
    HighOrderMesh mesh = start;
    GeometryOptions options = coupled();
    const StopToken stop([&] { return ++looks > most; });
    options.stop = &stop;
    looks = 0;
    try {
      slid(mesh, options);
      EXPECT_NE(mesh.coordinates, start.coordinates);
      return true;
    } catch (const Interrupted&) {
      EXPECT_EQ(mesh.coordinates, start.coordinates);
      return false;
    }
  };
  ASSERT_TRUE(slides(std::numeric_limits<int>::max()));
  const int all = looks;
  for (const int most : {0, all / 4, all / 2, 3 * all / 4, all - 1}) EXPECT_FALSE(slides(most)) << most;
  EXPECT_TRUE(slides(all));
}

TEST(Coupled, KeepsWhatSlidBottomUpIfItsTimeIsOver) {
  const HighOrderMesh start = DiscMesh(1, 3).mesh();
  HighOrderMesh bottom_up = start;
  slid(bottom_up, {});
  ASSERT_NE(bottom_up.coordinates, start.coordinates);
  int looks = 0;
  const auto slides = [&](int most) {
    StopToken stop([&] {
      if (++looks > most) stop.stop_after(0);
      return false;
    });
    HighOrderMesh mesh = start;
    GeometryOptions options = coupled();
    options.threads = 1;
    options.stop = &stop;
    looks = 0;
    const auto done = slide_on_model(mesh, options, solid_cylinder());
    EXPECT_TRUE(done) << done.error().sentence;
    const bool says_so = done && done->sentences.back().starts_with("The time was over");
    return std::pair(mesh.coordinates, says_so);
  };
  const auto [whole, is_late] = slides(std::numeric_limits<int>::max());
  EXPECT_FALSE(is_late);
  const int all = looks;
  for (const int most : {3 * all / 4, all - 1}) {
    const auto [coordinates, says_so] = slides(most);
    EXPECT_TRUE(says_so) << most;
    EXPECT_EQ(coordinates, bottom_up.coordinates) << most;
  }
}

TEST(Coupled, FixedNodesStay) {
  HighOrderMesh start = DiscMesh(2, 3).mesh(), mesh;
  start.blocks[0].physical = {7};
  mesh = start;
  GeometryOptions options = coupled();
  options.fix = {"7"};
  slid(mesh, options);
  for (const std::int32_t node : start.blocks[0].nodes)
    for (std::size_t c = 3 * static_cast<std::size_t>(node); c < 3 * static_cast<std::size_t>(node) + 3; ++c)
      EXPECT_EQ(mesh.coordinates[c], start.coordinates[c]);
  EXPECT_NE(mesh.coordinates, start.coordinates);
}

TEST(Coupled, RefusesWhatDoesNotGoTogether) {
  const HighOrderMesh start = DiscMesh(1, 3).mesh();
  const auto sentence = [&](const GeometryOptions& options) {
    HighOrderMesh mesh = start;
    const auto slid = slide_on_file(mesh, options);
    EXPECT_FALSE(slid);
    EXPECT_EQ(mesh.coordinates, start.coordinates);
    return slid ? std::string() : slid.error().sentence;
  };
  GeometryOptions options = coupled();
  options.slide_on = GeometrySource::Boundary;
  EXPECT_NE(sentence(options).find("needs a model"), std::string::npos);
  options.slide_on = GeometrySource::Model;
  options.tolerance = -1;
  EXPECT_NE(sentence(options).find("give a length"), std::string::npos);
  options.tolerance = 0.1;
  options.slide = SlideOn::All;
  EXPECT_NE(sentence(options).find("goes only with"), std::string::npos);
}

/// The energies of a mesh of the cylinder whose nodes all move. Make it inside team.run().
struct Energies {
  std::vector<bool> none;
  Association association;
  std::vector<std::vector<detail::EntityElement>> curves, surfaces;
  detail::BoundaryEnergy boundary;
  detail::VolumeEnergy volume;

  Energies(const HighOrderMesh& mesh, const Team& team)
      : none(mesh.node_count(), false),
        association(associate(mesh, solid_cylinder(), team).value()),
        curves(detail::curve_elements(mesh, association)),
        surfaces(detail::surface_elements(mesh, association)),
        boundary({association, curves, surfaces, mesh.order, mesh.coordinates, mesh.coordinates, none}, team),
        volume(mesh, none, team) {
    boundary.prepare(mesh, volume.volumes(), volume.nodes(), volume.diagonal());
  }
};

/// All nodes move some steps. Then only those of elements that exceed a limit of distance are held back.
TEST(CoupledHoldBack, HoldsOnlyTheNodesThatExceedTheLimit) {
  const HighOrderMesh mesh = DiscMesh(2, 3).mesh();
  const Team team(2);
  team.run([&] {
    Energies energies(mesh, team);
    detail::BoundaryEnergy& boundary = energies.boundary;
    detail::VolumeEnergy& volume = energies.volume;
    detail::CoupledNewton newton(volume, boundary, mesh.coordinates, team);
    const detail::CoupledState start = newton.state();
    const auto before = boundary.distance(newton.coordinates());
    for (int k = 0; k < 8; ++k) newton.step(0.5);
    const detail::CoupledState end = newton.state();
    const auto after = boundary.distance(newton.coordinates());
    const double room = after.surfaces.largest - before.surfaces.largest;
    ASSERT_GT(room, 0);
    constexpr double kAny = 1e9;
    const detail::DistanceLimit any{kAny, kAny};

    EXPECT_TRUE(detail::hold_back(start, end, any, any, newton, boundary));
    for (std::size_t k = 0; k < end.coordinates.size(); ++k)
      EXPECT_NEAR(newton.coordinates()[k], end.coordinates[k], 1e-12);

    const detail::DistanceLimit largest{before.surfaces.largest + 0.6 * room, kAny};
    ASSERT_TRUE(detail::hold_back(start, end, largest, any, newton, boundary));
    EXPECT_LE(boundary.distance(newton.coordinates()).surfaces.largest, largest.largest);
    int at_end = 0, held = 0;
    for (std::size_t node = 0; node < mesh.node_count(); ++node) {
      if (!boundary.slides(static_cast<std::int32_t>(node))) continue;
      const auto of = [&](const std::vector<double>& x) {
        return Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(&x[3 * node]));
      };
      const double way = (of(end.coordinates) - of(start.coordinates)).norm();
      const double left = (of(end.coordinates) - of(newton.coordinates())).norm();
      if (way < 1e-3) continue;
      EXPECT_LT(left, way);
      (left < 1e-9 ? at_end : held) += 1;
    }
    EXPECT_GT(at_end, 0);
    EXPECT_GT(held, 0);

    const detail::DistanceLimit rms{kAny, 0.5 * (before.surfaces.rms() + after.surfaces.rms())};
    ASSERT_TRUE(detail::hold_back(start, end, rms, any, newton, boundary));
    EXPECT_LE(boundary.distance(newton.coordinates()).surfaces.rms(), rms.rms);

    const detail::DistanceLimit less{0.5 * before.surfaces.largest, kAny};
    EXPECT_FALSE(detail::hold_back(start, end, less, any, newton, boundary)) << "the start exceeds it already";
  });
}

/// The gradients of both energies against differences, in the direction of some smooth displacement of all nodes along
/// their entities.
TEST(CoupledEnergies, HaveTheGradientsThatDifferencesHave) {
  const HighOrderMesh mesh = DiscMesh(1, 3).mesh();
  const Team team(1);
  team.run([&] {
    Energies energies(mesh, team);
    detail::BoundaryEnergy& boundary = energies.boundary;
    detail::VolumeEnergy& volume = energies.volume;
    constexpr double kDelta = 0.5, kWeight = 2;
    volume.set_delta(kDelta);
    volume.energy(mesh.coordinates);
    std::vector<double> gradient(3 * volume.nodes().size());
    volume.cells().linearise(gradient);
    const auto directions = boundary.directions();
    const auto& hessian = boundary.linearise(kDelta, kWeight, false, directions, gradient);
    EXPECT_GT(hessian.norm(), 0);
    const Eigen::SparseMatrix<double, Eigen::RowMajor> first = hessian;
    std::vector<double> again(gradient.size());
    volume.cells().linearise(again);
    EXPECT_EQ((boundary.linearise(kDelta, kWeight, false, directions, again) - first).norm(), 0);
    EXPECT_LT((first - Eigen::SparseMatrix<double, Eigen::RowMajor>(first.transpose())).norm(), 1e-9 * first.norm());
    std::vector<double> step(gradient.size());
    double slope = 0;
    for (std::size_t rank = 0; rank < volume.nodes().size(); ++rank) {
      const Eigen::Vector3d x =
          Eigen::Map<const Eigen::Vector3d>(&mesh.coordinates[3 * static_cast<std::size_t>(volume.nodes()[rank])]);
      const Eigen::Vector3d wave(std::sin(3 * x[1]), std::cos(2 * x[2] + x[0]), std::sin(x[0] + x[1] + x[2]));
      const Eigen::Vector3d move = 0.01 * (directions[rank] * (directions[rank].transpose() * wave));
      for (int k = 0; k < 3; ++k) step[3 * rank + static_cast<std::size_t>(k)] = move[k];
      slope += move.dot(Eigen::Map<const Eigen::Vector3d>(&gradient[3 * rank])) / volume.diagonal();
    }
    const auto start = boundary.places();
    const auto energy_at = [&](double part) {
      std::vector<double> scaled = step, coordinates = mesh.coordinates;
      for (double& number : scaled) number *= part;
      for (std::size_t rank = 0; rank < volume.nodes().size(); ++rank)
        for (std::size_t k = 0; k < 3; ++k)
          coordinates[3 * static_cast<std::size_t>(volume.nodes()[rank]) + k] += scaled[3 * rank + k];
      boundary.move(start, scaled, coordinates);
      return volume.energy(coordinates) + boundary.value(kDelta, kWeight).energy;
    };
    const double part = 1e-3, difference = (energy_at(part) - energy_at(-part)) / (2 * part);
    EXPECT_NEAR(difference, slope, 1e-4 * std::abs(slope));
    EXPECT_NE(slope, 0);
  });
}

}  // namespace
}  // namespace varimesh
