// The shared cases, if they are there. With the reference constants, the minimum scaled Jacobians are those that an
// independent implementation of the method reached. With the standard constants and with Objective::Worst, they are
// limits below which this implementation must not fall.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/formats/formats.h"
#include "core/optimise/optimiser.h"

namespace varimesh {
namespace {

std::filesystem::path shared_case(const std::string& name) {
  const char* folder = std::getenv("VARIMESH_CASES");
  return std::filesystem::path(folder ? folder : VARIMESH_SOURCE_DIR "/../shared/cases") / "meshes" / (name + ".msh");
}

struct ReferenceCase {
  std::string name;
  double least;  ///< Lower limit of the minimum scaled Jacobian at the end.
  Constants constants = Constants::Reference;
  Objective objective = Objective::Energy;
};

std::string name(const ReferenceCase& one) {
  return one.name + (one.constants == Constants::Standard ? "_standard" : "_reference") +
         (one.objective == Objective::Worst ? "_worst" : "");
}

void PrintTo(const ReferenceCase& one, std::ostream* out) { *out << name(one); }

class ReferenceCases : public ::testing::TestWithParam<ReferenceCase> {};

TEST_P(ReferenceCases, ConvergeValid) {
  const std::filesystem::path path = shared_case(GetParam().name);
  if (!std::filesystem::exists(path))
    GTEST_SKIP() << "NOT RUN: the shared cases are not at " << path << "; set VARIMESH_CASES to their folder.";
  auto file = formats::read_file(path.string());
  ASSERT_TRUE(file) << file.error().sentence;
  Options options;
  options.constants = GetParam().constants;
  options.objective = GetParam().objective;
  const auto result = optimise(std::move(file->mesh), options);
  ASSERT_TRUE(result) << result.error().sentence;
  // The stages of Objective::Worst may oscillate until their iterations are used up.
  EXPECT_TRUE(result->converged || options.objective == Objective::Worst);
  EXPECT_EQ(result->after.invalid_elements, 0);
  EXPECT_GE(result->after.min_scaled_jacobian, GetParam().least);
}

INSTANTIATE_TEST_SUITE_P(Shared, ReferenceCases,
                         ::testing::Values(ReferenceCase{"sph276_p5", 0.67}, ReferenceCase{"circ500_p5", 0.73},
                                           ReferenceCase{"naca524_p5", 0.81},
                                           ReferenceCase{"reference_sphere276_p4", 0.755},
                                           ReferenceCase{"sph276_p5", 0.745, Constants::Standard},
                                           ReferenceCase{"circ500_p5", 0.91, Constants::Standard},
                                           ReferenceCase{"circ500m_p5", 0.935, Constants::Standard},
                                           ReferenceCase{"naca524_p5", 0.875, Constants::Standard},
                                           ReferenceCase{"sph276_p5", 0.81, Constants::Standard, Objective::Worst},
                                           ReferenceCase{"circ500_p5", 0.985, Constants::Standard, Objective::Worst},
                                           ReferenceCase{"circ500m_p5", 0.99, Constants::Standard, Objective::Worst},
                                           ReferenceCase{"naca524_p5", 0.93, Constants::Standard, Objective::Worst},
                                           ReferenceCase{"nacabl_p4", 0.45, Constants::Standard, Objective::Worst}),
                         [](const auto& info) { return name(info.param); });

}  // namespace
}  // namespace varimesh
