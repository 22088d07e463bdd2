#include "client/cli/names.h"

#include <gtest/gtest.h>

#include "varimesh/v1/job.pb.h"
#include "varimesh/v1/optimise.pb.h"

namespace varimesh::client {
namespace {

TEST(Names, SpellEnumsAsTheProtoSays) {
  EXPECT_EQ(spelled(v1::ENERGY_LINEAR_ELASTIC), "linear-elastic");
  EXPECT_EQ(spelled(v1::STRAIN_GREEN_LAGRANGE), "green-lagrange");
  EXPECT_EQ(spelled(v1::JOB_STATE_SUCCEEDED), "succeeded");
  EXPECT_EQ(spellings(*v1::Winslow_descriptor()), (std::vector<std::string>{"true", "paper"}));
}

TEST(Names, AnUnknownNumberHasNoSpelling) { EXPECT_EQ(spelled(static_cast<v1::Energy>(999)), ""); }

TEST(Names, ASpellingLeadsBackToItsValue) {
  for (const std::string& name : spellings(*v1::MeshFormat_descriptor())) {
    const auto* value = value_of(*v1::MeshFormat_descriptor(), name);
    ASSERT_NE(value, nullptr) << name;
    EXPECT_EQ(spelled(*value), name);
  }
  EXPECT_EQ(value_of(*v1::MeshFormat_descriptor(), "unspecified"), nullptr);
  EXPECT_EQ(value_of(*v1::MeshFormat_descriptor(), "xyz"), nullptr);
}

TEST(Names, FlagsHaveDashes) { EXPECT_EQ(dashed("max_iterations"), "max-iterations"); }

}  // namespace
}  // namespace varimesh::client
