// What the command says about remedies: every kind of the contract has words of its own.
#include "client/cli/remedies.h"

#include <gtest/gtest.h>

namespace varimesh::client {
namespace {

v1::Remedy remedy(v1::Remedy::Kind kind) {
  v1::Remedy made;
  made.set_kind(kind);
  made.set_order(3);
  made.set_reason("it helps.");
  made.set_sentence("Set a field of the contract: it helps.");
  return made;
}

TEST(Remedies, AreSaidWithTheFlagsOfTheCommand) {
  EXPECT_EQ(sentence_of(remedy(v1::Remedy::KIND_OPTIMISE)), "Try varimesh optimise: it helps.");
  EXPECT_EQ(sentence_of(remedy(v1::Remedy::KIND_UNTIL_VALID)), "Try --until valid: it helps.");
  EXPECT_EQ(sentence_of(remedy(v1::Remedy::KIND_RAISE_ORDER)), "Try --order 3: it helps.");
  EXPECT_EQ(sentence_of(remedy(v1::Remedy::KIND_SPLIT)), "Try --repair split: it helps.");
  EXPECT_NE(sentence_of(remedy(v1::Remedy::KIND_SLIDE)).find("--geometry MODEL"), std::string::npos);
  EXPECT_EQ(flags_of(remedy(v1::Remedy::KIND_SLIDE)), "--slide-on boundary");
  EXPECT_EQ(flags_of(remedy(v1::Remedy::KIND_MORE_TIME)), "");
}

TEST(Remedies, OfEveryKindHaveWords) {
  const auto* kinds = v1::Remedy::Kind_descriptor();
  for (int i = 0; i < kinds->value_count(); ++i) {
    const auto kind = static_cast<v1::Remedy::Kind>(kinds->value(i)->number());
    const bool is_older = kind == v1::Remedy::KIND_UNSPECIFIED;
    EXPECT_EQ(sentence_of(remedy(kind)) == remedy(kind).sentence(), is_older) << kinds->value(i)->name();
  }
}

TEST(Remedies, OfTheLibraryAreThoseOfTheContract) {
  const v1::Remedy made = to_proto({Remedy::Kind::RaiseOrder, 2, "it helps.", 3});
  EXPECT_EQ(made.kind(), v1::Remedy::KIND_RAISE_ORDER);
  EXPECT_EQ(made.elements(), 2);
  EXPECT_EQ(sentence_of(made), "Try --order 3: it helps.");
}

}  // namespace
}  // namespace varimesh::client
